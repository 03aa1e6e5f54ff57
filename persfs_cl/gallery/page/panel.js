// One image: its relief, its figures, and links to its files.

class Panel {
  /** `step` is called with -1 or 1 for the image before or after, `close` when it is to be closed. */
  constructor({ step, close, changed }) {
    this.section = find("#panel");
    this.record = null;
    this.viewer = new Viewer(find("#relief canvas"), () => {
      this.press();
      changed();
    });
    find("#previous").addEventListener("click", () => step(-1));
    find("#next").addEventListener("click", () => step(1));
    find("#close").addEventListener("click", close);
    find("#wear").addEventListener("click", ({ target }) => target.value && this.viewer.put(target.value));
    find("#views").addEventListener("click", ({ target }) => {
      if (target.value) this.viewer.look(target.value === "front" ? FRONT : OPENING);
    });
    this.press();
  }

  press() {
    for (const button of find("#wear").children) button.setAttribute("aria-pressed", button.value === this.viewer.wear);
  }

  say(text) {
    find("#message").hidden = !text;
    find("#message").textContent = text;
  }

  /** Open it on a record; null closes it. */
  async open(record) {
    this.record = record;
    this.section.hidden = !record;
    if (!record) {
      this.viewer.show(null);
      return;
    }
    this.section.querySelector("h2").textContent = title(record);
    find("#facts").replaceChildren(...this.facts(record));
    this.section.scrollTop = 0;
    const drawn = files(record).includes("relief.js");
    const still = find("#relief > img");
    find("#relief").hidden = !drawn;
    still.hidden = true;
    if (!drawn) return;
    const canvas = find("#relief canvas");
    canvas.setAttribute("aria-label", `Relief of ${title(record)}`);
    canvas.setAttribute("aria-busy", "true");
    this.say("");
    const late = setTimeout(() => this.record === record && this.say("Loading …"), 300);
    try {
      if (!this.viewer.able) throw new Error("This browser has no WebGL, which turns the relief");
      const heights = await loadHeights(address(record.name, "relief.js"));
      if (this.record !== record) return;
      await this.viewer.show(heights);
      this.say(heights.depth ? "" : "No pixel of this image has a depth.");
    } catch (error) {
      if (this.record !== record) return;
      this.viewer.show(null);
      if (files(record).includes("preview.jpg")) {
        still.src = address(record.name, "preview.jpg");
        still.hidden = false;
      }
      this.say(`${error.message}.`);
    } finally {
      clearTimeout(late);
      if (this.record === record) requestAnimationFrame(() => canvas.setAttribute("aria-busy", "false"));
    }
  }

  facts(record) {
    const made = [];
    if (failed(record)) {
      const { kind, message } = record.error ?? {};
      const text = message ?? "No reason is known.";
      made.push(element("p", { className: "note error" }, ...(kind ? [element("b", {}, kind), ": ", text] : [text])));
    }
    for (const warning of warnings(record)) made.push(element("p", { className: "note warning" }, warning));
    const { focal_length: lengths, solved, unreached, clamped, at_bound: bound, guide } = figures(record);
    const parts = Object.entries(record.seconds ?? {}).map(([step, value]) => `${step} ${duration(value)}`);
    const shown = columns.slice(2).filter(({ key }) => key !== "warnings" && key !== "solved" && key !== "seconds");
    const pairs = [
      ["Outcome", failed(record) ? null : end(record)],
      ...shown.map((column) => [column.full ?? column.label, measured(column, record)]),
      ["Median depth", figure(figures(record).depth_median)],
      ["Focal length", lengths ? `${[...new Set(lengths)].map((value) => figure(value)).join(" × ")} px` : null],
      ["Solved pixels", Number.isFinite(solved) ? `${figure(solved)} (${percent(share(record))})` : null],
      ["Unreached pixels", unreached ? figure(unreached) : null],
      ["Clamped pixels", clamped ? figure(clamped) : null],
      ["Pixels on a bound", bound ? figure(bound) : null],
      ["Guide", guide ? `${guide.used} of ${guide.cells} values used, noise ${percent(guide.noise)}` : null],
      ["Gain, by the guide", guide?.gain ? figure(guide.gain) : null],
      ["Time", seconds(record) === undefined ? null : `${duration(seconds(record))} (${parts.join(", ")})`],
      ["Device", record.device],
      ["Finished", record.finished ? new Date(record.finished).toLocaleString() : null],
      ["Photograph", record.path],
    ];
    made.push(element("dl", {}, ...definitions(pairs)));
    if (files(record).length) {
      const links = listed(record).map((file) =>
        element("li", {}, element("a", { href: address(record.name, file), target: "_blank", rel: "noopener" }, file)),
      );
      made.push(element("h3", {}, "Files"), element("ul", { className: "files" }, ...links));
    }
    return made;
  }
}
