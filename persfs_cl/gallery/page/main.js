// The page: what is chosen, filtered and sorted, and its address, which holds the view.

const single = records.length === 1 && about.total === 1;
const order = { words: "", state: "all", column: "name", descending: false };
const narrow = window.matchMedia("(max-width: 860px)");
let rows = [];
let table = null;

const panel = new Panel({ step, close: () => open(null), changed: remember });

/** Open an image, in the table too; null closes the panel. */
function open(record, focus = false) {
  const before = panel.record;
  if (record !== before) panel.open(record);
  cover();
  if (table) {
    table.choose(record ?? before, !record || focus);
    if (!record) {
      table.chosen = null;
      table.mark();
    }
  }
  ends();
  remember();
}

/** No way before the first image, nor after the last. */
function ends() {
  const place = rows.indexOf(panel.record);
  find("#previous").disabled = place <= 0;
  find("#next").disabled = place === rows.length - 1;
}

/** Where the panel lies over all else, nothing below it can be reached. */
function cover() {
  const covered = narrow.matches && !single && panel.record !== null;
  for (const part of ["#top", "#tools", "#list"]) find(part).inert = covered;
  if (covered && !panel.section.contains(document.activeElement)) panel.section.querySelector("h2").focus();
}

function step(by) {
  const record = rows[rows.indexOf(panel.record) + by];
  if (record) open(record);
}

/** Filter and sort anew. */
function arrange(change, fromTop = true) {
  Object.assign(order, change);
  rows = selected(order);
  table.show(rows, order, fromTop);
  for (const button of find("#states").children) button.setAttribute("aria-pressed", button.value === order.state);
  find("#order select").value = `${order.column} ${order.descending ? "down" : "up"}`;
  const some = rows.length < records.length;
  find("#shown").textContent = some ? `${figure(rows.length)} of ${figure(records.length)}` : "";
  ends();
}

function sort(column) {
  arrange({ column, descending: order.column === column && !order.descending });
}

// The address holds what one looks at: #relief=NAME&turn=YAW,PITCH&zoom=Z&move=X,Y&wear=bare, of which any may be left
// out.

function addressed() {
  const pairs = location.hash.slice(1).split("&").map((pair) => pair.split("="));
  return Object.fromEntries(pairs.map(([name, ...value]) => [name, value.join("=")]));
}

function follow() {
  const wanted = addressed();
  const numbers = (text) => (text ?? "").split(",").map(Number);
  const view = { ...OPENING };
  const take = (name, keys) => {
    const values = numbers(wanted[name]);
    if (wanted[name] && values.length === keys.length && values.every(Number.isFinite)) {
      keys.forEach((key, at) => (view[key] = values[at]));
    }
  };
  take("turn", ["yaw", "pitch"]);
  take("zoom", ["zoom"]);
  take("move", ["x", "y"]);
  // Written by hand, it may have signs that are not quoted.
  const canonical = (part) => (/^%./.test(part) ? part.toUpperCase() : quoted(part));
  const named = wanted.relief?.replace(/%[0-9a-f]{2}|[^%]+|%/gi, canonical);
  const record = single ? records[0] : records.find(({ name }) => quoted(name) === named);
  if (record) open(record);
  if (location.hash) {
    panel.viewer.put(wanted.wear);
    panel.viewer.look(view);
  }
  return record;
}

let remembering = 0;

/** Have the address hold the view, without a step in the browser's history for each. */
function remember() {
  clearTimeout(remembering);
  remembering = setTimeout(() => {
    if (!panel.record) {
      if (location.hash) history.replaceState(null, "", "#");
      return;
    }
    const { yaw, pitch, zoom, x, y } = panel.viewer.view;
    const round = (value) => Number(value.toFixed(2));
    const parts = [`relief=${quoted(panel.record.name)}`, `turn=${round(yaw)},${round(pitch)}`];
    if (zoom !== 1) parts.push(`zoom=${round(zoom)}`);
    if (x || y) parts.push(`move=${round(x)},${round(y)}`);
    if (panel.viewer.wear === "bare") parts.push("wear=bare");
    history.replaceState(null, "", `#${parts.join("&")}`);
  }, 250);
}

function totals() {
  const count = (key) => records.filter(states.find((state) => state.key === key).test).length;
  const spent = records.reduce((sum, record) => sum + (seconds(record) ?? 0), 0);
  const parts = [counted(about.total, "image"), `${figure(about.total - about.failed)} done`];
  if (about.failed) parts.push(`${figure(about.failed)} failed`);
  if (spent) parts.push(`${duration(spent)} of processing`);
  let text = parts.join(" · ");
  if (records.length < about.total) {
    const listed = `${figure(records.length)}, ${figure(count("failed"))} of them failed`;
    text += ` · listed here: ${listed}; summary.csv has all`;
  }
  // The title of a single image is its file, of which the path may say no more.
  if (single) text = records[0].path === about.title ? "" : records[0].path ?? "";
  find("#totals").textContent = text;
}

function tools() {
  for (const { key, label, test } of states) {
    const count = records.filter(test).length;
    if (key !== "all" && (count === 0 || (key === "done" && count === records.length))) continue;
    const button = element("button", { type: "button", value: key }, label, element("span", {}, figure(count)));
    button.addEventListener("click", () => arrange({ state: key }));
    find("#states").append(button);
  }
  const select = find("#order select");
  for (const { key, label, number } of columns) {
    for (const direction of ["up", "down"]) {
      const words = number ? { up: "least first", down: "largest first" } : { up: "A to Z", down: "Z to A" };
      select.append(element("option", { value: `${key} ${direction}` }, `${label}, ${words[direction]}`));
    }
  }
  select.addEventListener("change", () => {
    const [column, direction] = select.value.split(" ");
    arrange({ column, descending: direction === "down" });
  });
  let typing = 0;
  find("#filter").addEventListener("input", ({ target }) => {
    clearTimeout(typing);
    typing = setTimeout(() => arrange({ words: target.value }), 80);
  });
  find("#nothing button").addEventListener("click", () => {
    find("#filter").value = "";
    arrange({ words: "", state: "all" });
  });
}

function parameters() {
  const button = find("#show-parameters");
  const section = find("#parameters");
  section.querySelector("dl").append(...definitions(Object.entries(about.parameters)));
  button.hidden = Object.keys(about.parameters).length === 0;
  button.addEventListener("click", () => {
    section.hidden = !section.hidden;
    button.setAttribute("aria-expanded", !section.hidden);
  });
}

totals();
parameters();
if (single) {
  document.body.classList.add("single");
} else {
  tools();
  table = new Table(find("#list"), { open: (record) => open(record), sort });
  arrange({});
  find("#list").tabIndex = -1;
}
// Where there is room for both, one sees at once what there is to be seen.
if (!follow() && window.innerWidth > 1100) {
  const first = rows.find((record) => files(record).includes("relief.js"));
  if (first) open(first);
}
window.addEventListener("hashchange", follow);
narrow.addEventListener("change", cover);
window.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && panel.record && !single) open(null);
  if (event.key === "/" && !single && !/^(INPUT|SELECT)$/.test(document.activeElement.tagName)) {
    event.preventDefault();
    find("#filter").focus();
  }
});
