// What is known of each image, and which of them are shown, in what order.

const records = JSON.parse(find("#records").textContent);
const about = JSON.parse(find("#about").textContent);

const figures = (record) => record.figures ?? {};
const failed = (record) => record.status === "failed";
const warnings = (record) => record.warnings ?? [];
const files = (record) => record.files ?? [];
const seconds = (record) => {
  const parts = Object.values(record.seconds ?? {}).filter(Number.isFinite);
  return parts.length ? parts.reduce((sum, part) => sum + part, 0) : undefined;
};
const pixels = (record) => (record.size ? record.size[0] * record.size[1] : undefined);
const share = (record) => (pixels(record) ? figures(record).solved / pixels(record) : undefined);
const percent = (value) => {
  if (!Number.isFinite(value)) return MISSING;
  // All but a few is not all.
  return `${value > 0.999 && value < 1 ? "99.9" : figure(100 * value, 3)} %`;
};
const dimensions = (record) => (record.size ? `${record.size[1]} × ${record.size[0]}` : MISSING);
const ENDS = { CONVERGED: "converged", MAX_ITERATIONS: "not converged", STOPPED: "stopped" };
/** How a run ended, where it is asked of one image: that it is done says little. */
const end = (record) => ENDS[record.converged] ?? outcome(record).text;
/** What the pages are made of, and nobody opens by itself. */
const INTERNAL = ["preview.jpg", "photo.jpg", "relief.js", "index.html"];
const listed = (record) => {
  const inside = (file) => INTERNAL.includes(file);
  return [...files(record).filter((file) => !inside(file)), ...files(record).filter(inside)];
};
const title = (record) => record.name || (record.path ?? "").split("/").pop() || about.title;

function outcome(record) {
  if (failed(record)) return { text: "failed", kind: "bad" };
  if (record.converged && record.converged !== "CONVERGED") {
    return { text: ENDS[record.converged] ?? record.converged, kind: "warn" };
  }
  return { text: "done", kind: "good" };
}

/** Columns of the table, as wide as said; those of a higher rank give way first when there is no room. */
const columns = [
  { key: "name", label: "Name", rank: 0, value: title },
  { key: "status", label: "Status", rank: 1, width: 126, value: (record) => outcome(record).text },
  { key: "size", label: "Size", rank: 2, width: 116, number: true, value: pixels, text: dimensions },
  {
    key: "depth", label: "Depth", rank: 2, width: 150, number: true, value: (record) => figures(record).depth_median,
    text: (record) => depths(record), about: "Least to largest depth; sorted by the median",
  },
  { key: "solved", label: "Solved", rank: 1, width: 88, number: true, value: share,
    text: (record) => percent(share(record)), about: "Pixels that have a depth" },
  { key: "error", label: "Grey error", full: "Mean grey error", unit: "of 255", rank: 0, width: 108, number: true, value: (record) => figures(record).mean_error,
    digits: 3, about: "Mean difference between the photograph and the surface re-rendered, in grey levels of 255" },
  { key: "rms", label: "Grey RMS", full: "RMS grey error", unit: "of 255", rank: 3, width: 100, number: true, digits: 3,
    value: (record) => figures(record).root_mean_square, about: "Root mean square of the same differences" },
  { key: "iterations", label: "Iterations", rank: 3, width: 104, number: true, value: (record) => record.iterations },
  { key: "view", label: "Field of view", rank: 3, width: 122, number: true, value: (record) => figures(record).horizontal_view,
    text: (record) => angle(record), about: "Horizontal field of view" },
  { key: "seconds", label: "Time", rank: 1, width: 84, number: true, value: seconds,
    text: (record) => duration(seconds(record)), about: "Reading, preparing, solving and writing together" },
  { key: "warnings", label: "Warnings", rank: 2, width: 100, number: true, value: (record) => warnings(record).length,
    text: (record) => (warnings(record).length ? figure(warnings(record).length) : MISSING) },
];

function depths(record) {
  const { depth_min: least, depth_max: largest } = figures(record);
  return Number.isFinite(least) ? `${figure(least, 4)} – ${figure(largest, 4)}` : MISSING;
}

function angle(record) {
  const view = figures(record).horizontal_view;
  return Number.isFinite(view) ? `${figure(view, 3)}°` : MISSING;
}

const cell = (column, record) => (column.text ? column.text(record) : figure(column.value(record), column.digits));

/** The same with its unit, where it stands alone. */
const measured = (column, record) => {
  const text = cell(column, record);
  return column.unit && text !== MISSING ? `${text} ${column.unit}` : text;
};

const states = [
  { key: "all", label: "All", test: () => true },
  { key: "done", label: "Done", test: (record) => !failed(record) },
  { key: "failed", label: "Failed", test: failed },
  { key: "unfinished", label: "Not converged", test: (record) => outcome(record).kind === "warn" },
  { key: "warnings", label: "With warnings", test: (record) => warnings(record).length > 0 },
];

const searched = new Map();

/** All text of a record in which one may look for words. */
function haystack(record) {
  let text = searched.get(record);
  if (text === undefined) {
    const parts = [record.name, record.path, record.error?.kind, record.error?.message, outcome(record).text];
    text = [...parts, record.device, ...warnings(record)].filter(Boolean).join("\n").toLowerCase();
    searched.set(record, text);
  }
  return text;
}

const inOrder = new Intl.Collator("en", { numeric: true }).compare;

/** Records with all of some words, in the order of a column; those without a value come last either way. */
function selected({ words, state, column, descending }) {
  const wanted = words.toLowerCase().split(/\s+/).filter(Boolean);
  const { test } = states.find(({ key }) => key === state);
  const { value, number } = columns.find(({ key }) => key === column);
  const rows = records
    .filter((record) => test(record) && wanted.every((word) => haystack(record).includes(word)))
    .map((record, place) => ({ record, place, value: value(record) }));
  const known = (row) => (number ? Number.isFinite(row.value) : Boolean(row.value));
  const sign = descending ? -1 : 1;
  rows.sort((one, other) => {
    if (known(one) !== known(other)) return known(one) ? -1 : 1;
    const difference = !known(one) ? 0 : number ? one.value - other.value : inOrder(one.value, other.value);
    return sign * difference || one.place - other.place;
  });
  return rows.map(({ record }) => record);
}
