// Which trained legs walk, where there is a choice: the motion prior's or its ablations.

export class Legs {
  #names = "";

  // post(path): asks the server as this client; tells the reason when it refuses.
  constructor($, post) {
    this.row = $("#legs");
    this.select = this.row.querySelector("select");
    this.select.addEventListener("change", async () => {
      await post("/api/policy", { name: this.select.value });
      this.select.blur(); // the keys belong to the robot again
    });
  }

  show({ policy, policies }) {
    if (this.#names !== policies.join()) {
      this.#names = policies.join();
      this.row.hidden = policies.length < 2;
      this.select.replaceChildren(...policies.map((name) => new Option(name, name)));
    }
    if (this.row.getRootNode().activeElement !== this.select) this.select.value = policy;
  }
}
