// Saving, opening, importing and exporting.

export class Files {
  // say(text, bad); taken(curves, from) with the curves of a file
  constructor({ link, store, say, taken, elements }) {
    Object.assign(this, { link, store, say, taken, elements });
    elements.save.addEventListener("click", () => this.save());
    elements.open.addEventListener("click", () => elements.curveFile.click());
    elements.import.addEventListener("click", () => elements.motionFile.click());
    for (const input of [elements.curveFile, elements.motionFile]) {
      input.addEventListener("change", () => { this.take(input.files[0]); input.value = ""; });
    }
    elements.export.addEventListener("change", () => {
      this.export(elements.export.value);
      elements.export.value = "";
    });
    document.addEventListener("dragover", (event) => event.preventDefault());
    document.addEventListener("drop", (event) => {
      event.preventDefault();
      this.take(event.dataTransfer.files[0]);
    });
  }

  save() { return this.receive({ type: "save", curve: this.store.curve }, "saved"); }

  export(format) {
    const { curve, region, place } = this.store.current;
    if (format === "mp4") this.say("Filming; this takes a while. You can go on editing.");
    return this.receive({ type: "export", format, curve, region, place }, "exported");
  }

  async receive(request, done) {
    try {
      const file = await this.link.ask(request);
      download(file.name, file.payload);
      this.say(`${file.name} ${done}`);
    } catch (error) {
      this.say(error.message, true);
    }
  }

  async take(file) {
    if (!file) return;
    try {
      const curve = /\.ya?ml$/i.test(file.name);
      if (!curve) this.say(`Reading ${file.name} …`);
      const name = file.name.replace(/[^\w ().+-]/g, "_").replace(/^\.+/, "");
      const answer = curve
        ? await this.link.ask({ type: "load", name, text: await file.text() })
        : await this.link.ask({ type: "import", name }, await file.arrayBuffer());
      this.taken(answer.curves, file.name, !curve);
    } catch (error) {
      this.say(error.message, true);
    }
  }
}

function download(name, payload) {
  const anchor = document.createElement("a");
  anchor.href = URL.createObjectURL(new Blob([payload]));
  anchor.download = name;
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(anchor.href), 10_000);
}
