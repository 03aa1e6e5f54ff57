// The table: as many rows as fit are drawn, whatever their number, between two empty ones as high as the others.

class Table {
  /** `open` is called with a record when it is chosen, `sort` with the key of a column when its head is pressed. */
  constructor(section, { open, sort }) {
    this.section = section;
    this.body = section.querySelector("tbody");
    this.open = open;
    this.rows = [];
    this.drawn = new Map();
    this.chosen = null;
    this.height = parseFloat(getComputedStyle(section).getPropertyValue("--row"));
    this.before = this.space();
    this.after = this.space();
    this.body.append(this.before, this.after);
    this.head(sort);
    this.fit();
    section.addEventListener("scroll", () => this.draw(), { passive: true });
    new ResizeObserver(() => this.fit()).observe(section);
    this.body.addEventListener("click", (event) => this.press(event));
    this.body.addEventListener("keydown", (event) => this.key(event));
  }

  space() {
    return element("tr", { className: "space", "aria-hidden": "true" }, element("td"));
  }

  /** Show as many columns as there is room for. */
  fit() {
    const ranks = [780, 1160, 1480].filter((width) => this.section.clientWidth >= width).length;
    if (Number(this.section.dataset.ranks) !== ranks) {
      this.section.dataset.ranks = ranks;
      this.columns = columns.filter(({ rank }) => rank <= ranks);
      this.clear();
    }
    this.draw();
  }

  clear() {
    for (const row of this.drawn.values()) row.remove();
    this.drawn.clear();
  }

  head(sort) {
    const group = this.section.querySelector("colgroup");
    const row = this.section.querySelector("thead tr");
    for (const label of ["Photo", "Relief"]) {
      const rank = label === "Photo" ? "" : "rank1";
      group.append(element("col", { className: rank, style: "width: 88px" }));
      row.append(element("th", { scope: "col", className: rank }, element("button", { disabled: true }, label)));
    }
    for (const { key, label, rank, width, number, about: hint } of columns) {
      const place = rank ? `rank${rank}` : "";
      group.append(element("col", { className: place, style: width ? `width: ${width}px` : "" }));
      const button = element("button", { type: "button", title: hint ?? "" }, label);
      button.addEventListener("click", () => sort(key));
      const className = `${place} ${number ? "number" : ""}`;
      row.append(element("th", { scope: "col", className, "data-key": key }, button));
    }
  }

  /** Show these records, from the top or from where one looks now. */
  show(rows, { column, descending }, fromTop) {
    for (const head of this.section.querySelectorAll("th[data-key]")) {
      if (head.dataset.key === column) head.setAttribute("aria-sort", descending ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    }
    this.rows = rows;
    this.clear();
    this.section.querySelector("table").setAttribute("aria-rowcount", rows.length + 1);
    find("#nothing").hidden = rows.length > 0;
    if (fromTop) this.section.scrollTop = 0;
    this.draw();
  }

  draw() {
    const top = this.section.scrollTop;
    const room = this.section.clientHeight;
    const first = Math.max(0, Math.floor(top / this.height) - 4);
    const end = Math.min(this.rows.length, Math.ceil((top + room) / this.height) + 4);
    const gone = [...this.drawn].filter(([place]) => place < first || place >= end);
    // Before anything changes: a browser that takes the focus from a row as it is removed looks at the table, and where
    // that is unfinished, scrolls to its end.
    if (gone.some(([, row]) => row === document.activeElement)) this.section.focus({ preventScroll: true });
    for (const [place, row] of gone) {
      row.remove();
      this.drawn.delete(place);
    }
    let following = this.after;
    for (let place = end - 1; place >= first; place -= 1) {
      let row = this.drawn.get(place);
      if (!row) {
        row = this.row(this.rows[place], place);
        this.drawn.set(place, row);
        this.body.insertBefore(row, following);
      }
      following = row;
    }
    this.before.firstChild.style.height = `${first * this.height}px`;
    this.after.firstChild.style.height = `${Math.max(0, this.rows.length - end) * this.height}px`;
    this.mark();
  }

  row(record, place) {
    const made = element("tr", { className: failed(record) ? "failed" : "", "aria-rowindex": place + 2 });
    made.dataset.place = place;
    made.append(this.picture(record, "photo.jpg", ""), this.picture(record, "preview.jpg", "rank1"));
    const name = this.name(record);
    made.append(name);
    if (failed(record)) {
      const { kind = "", message = "No reason is known." } = record.error ?? {};
      const reason = [element("div", { className: "reason", title: message }, message), element("small", {}, kind)];
      if (this.columns.some(({ key }) => key === "status")) {
        made.append(element("td", { colSpan: this.columns.length - 1 }, ...reason));
      } else {
        name.colSpan = this.columns.length;
        name.replaceChildren(element("b", {}, title(record)), reason[0]);
      }
      return made;
    }
    for (const column of this.columns.slice(1)) {
      const { key, number } = column;
      const data = element("td", { className: number ? "number" : "" });
      const { text, kind } = outcome(record);
      data.append(key === "status" ? element("span", { className: `state ${kind}` }, text) : cell(column, record));
      made.append(data);
    }
    return made;
  }

  /** The file's name, then its folder, then its first warning. */
  name(record) {
    const whole = title(record);
    const end = whole.lastIndexOf("/") + 1;
    const made = element("td", { className: "name", title: whole }, element("b", {}, whole.slice(end)));
    if (end) made.append(element("small", {}, whole.slice(0, end)));
    const [warning] = warnings(record);
    if (warning) made.append(element("small", { className: "warning", title: warning }, warning));
    return made;
  }

  picture(record, file, rank) {
    const data = element("td", { className: `picture ${rank}` });
    if (files(record).includes(file)) {
      data.append(element("img", { src: address(record.name, file), alt: "", decoding: "async", draggable: false }));
    }
    return data;
  }

  /** Mark the chosen row, and let one row be reached with the Tab key. */
  mark() {
    const chosen = this.rows.indexOf(this.chosen);
    const reached = this.drawn.has(chosen) ? chosen : Math.ceil(this.section.scrollTop / this.height);
    for (const [place, row] of this.drawn) {
      row.tabIndex = place === reached ? 0 : -1;
      row.setAttribute("aria-selected", place === chosen);
    }
  }

  /** Choose a record, and bring its row into sight. */
  choose(record, focus = false) {
    this.chosen = record;
    const place = this.rows.indexOf(record);
    if (place >= 0) {
      const head = this.section.querySelector("thead").offsetHeight;
      const top = place * this.height;
      const room = this.section.clientHeight - head;
      if (top < this.section.scrollTop) this.section.scrollTop = top;
      else if (top + this.height > this.section.scrollTop + room) this.section.scrollTop = top + this.height - room;
      this.draw();
      if (focus) this.drawn.get(place)?.focus({ preventScroll: true });
    }
    this.mark();
  }

  press(event) {
    const row = event.target.closest("tr[data-place]");
    if (row) this.open(this.rows[row.dataset.place]);
  }

  key(event) {
    const row = event.target.closest("tr[data-place]");
    if (!row || event.altKey || event.ctrlKey || event.metaKey) return;
    const page = Math.max(1, Math.floor(this.section.clientHeight / this.height) - 1);
    const last = this.rows.length - 1;
    const here = Number(row.dataset.place);
    const place = {
      ArrowDown: here + 1, ArrowUp: here - 1, PageDown: here + page, PageUp: here - page, Home: 0, End: last,
      Enter: here, " ": here,
    }[event.key];
    if (place === undefined) return;
    event.preventDefault();
    const record = this.rows[Math.min(Math.max(place, 0), last)];
    this.choose(record, true);
    if (event.key === "Enter" || event.key === " " || !find("#panel").hidden) this.open(record);
  }
}
