// Requests to the server. None fails silently.

const RETRY_MS = 1000;

// Resolves to what the server says: JSON, or null. Throws an Error whose message is a sentence for whoever asked.
export async function ask(path, method = "GET", body = undefined) {
  const json = body && { headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
  const answer = await fetch(path, { method, ...json }).catch(() => null);
  if (!answer) throw new Error("no connection to the robot");
  const said = await answer.json().catch(() => null);
  if (!answer.ok) throw new Error(typeof said?.detail === "string" ? said.detail : `the server answered with error ${answer.status}`);
  return said;
}

// The same for what a page cannot do without: again and again, until it is there. failed: called each time it is not.
export async function insist(path, failed) {
  for (;;) {
    try {
      return await ask(path);
    } catch {
      failed();
      await new Promise((resume) => setTimeout(resume, RETRY_MS));
    }
  }
}
