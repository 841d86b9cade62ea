// Runs before viser's client, as a classic script, and stands between the client and its connection (a Web Worker).
//
// - What viser draws may come from this page too: tap.deliver() hands it messages as if its server had sent them.
// - What viser would tell its server (dragged handles, the camera) is told to this page instead, as "sent" events.
//
// The page is made for one exact version of viser; app/viewer.py refuses to start with another one.
(() => {
  class Tap extends EventTarget {
    receive = null; // viser's own handler of what its worker says

    // Messages for viser's scene, in the format of viser's _messages.py.
    deliver(messages) {
      if (messages.length) this.receive?.({ data: { type: "message_batch", messages } });
    }

    tell(type, detail) {
      this.dispatchEvent(new CustomEvent(type, { detail }));
    }
  }

  const tap = new Tap();

  class TappedWorker extends Worker {
    postMessage(message, transfer) {
      if (message?.type === "send") tap.tell("sent", message.message);
      else super.postMessage(message, transfer);
    }

    set onmessage(handler) {
      super.onmessage = (event) => {
        const batch = event.data?.type === "message_batch" ? event.data.messages : [];
        if (event.data?.type === "connected") tap.receive = handler;
        if (batch.length) tap.tell("received", batch);
        handler(event);
        if (batch.some((message) => message.type === "ReplayDoneMessage")) tap.tell("scene");
      };
    }
  }

  window.Worker = TappedWorker;
  window.teleopTap = tap;
})();
