// From a script NAME/relief.js to the triangles of a surface.

/** Scripts that are on their way, and what to do with what they hand over: a page on a disk may load nothing else. */
const awaited = new Map();

window.persfsRelief = (heights) => awaited.get(document.currentScript)?.(heights);

/** What a script hands over; rejected when there is none. */
function loadHeights(url) {
  return new Promise((resolve, reject) => {
    const script = element("script", { src: url });
    awaited.set(script, resolve);
    const end = () => {
      awaited.delete(script);
      script.remove();
      reject(new Error("relief.js cannot be read")); // of no effect where it was handed over
    };
    script.addEventListener("load", end);
    script.addEventListener("error", end);
    document.head.append(script);
  });
}

const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

/** Pixel of a sample: see Samples in reduced.py. */
const pixel = (sample, count, size) => Math.floor(((2 * sample + 1) * size) / (2 * count));

/**
 * Points, normals and places in the photograph of all samples, and the triangles between them, in axes x right, y up
 * and z to the camera, about the middle of the surface, half as large as its box is wide across.
 */
function triangulated(heights) {
  const [height, width] = heights.size;
  const [rows, across] = heights.grid;
  const count = rows * across;
  const levels = new Uint16Array(bytes(heights.levels).buffer);
  const [least, largest] = heights.depth ?? [1, 1];
  const depth = Float64Array.from(levels, (level) => (level ? least + ((level - 1) / 65534) * (largest - least) : NaN));
  const [fx, fy] = heights.focal_length;
  const [cx, cy] = heights.principal_point;
  const columns = Float64Array.from({ length: across }, (_, at) => pixel(at, across, width));
  const lines = Float64Array.from({ length: rows }, (_, at) => pixel(at, rows, height));
  const x = columns.map((column) => (column - cx) / fx);
  const y = lines.map((line) => (line - cy) / fy);

  const points = new Float64Array(3 * count);
  const places = new Float32Array(2 * count);
  for (let at = 0; at < count; at += 1) {
    const row = Math.floor(at / across);
    const column = at - row * across;
    points[3 * at] = depth[at] * x[column];
    points[3 * at + 1] = -depth[at] * y[row];
    points[3 * at + 2] = -depth[at];
    places[2 * at] = (columns[column] + 0.5) / width;
    places[2 * at + 1] = (lines[row] + 0.5) / height;
  }
  const joins = joined(heights, levels, rows, across);
  const { middle, half } = box(points, depth);
  const shape = Float32Array.from(points, (value, at) => (Number.isNaN(value) ? 0 : (value - middle[at % 3]) / half));
  return {
    points: shape,
    places,
    normals: normals(depth, x, y, joins, rows, across),
    triangles: triangles(joins, rows, across),
  };
}

/** Whether the surface goes on from a sample to the one on the right, and to the one below. */
function joined({ right, down }, levels, rows, across) {
  const bit = (text) => {
    const data = bytes(text);
    return (at) => (data[at >> 3] >> (7 - (at & 7))) & 1;
  };
  const [toRight, below] = [right && bit(right), down && bit(down)];
  const joins = { right: new Uint8Array(rows * across), down: new Uint8Array(rows * across) };
  for (let row = 0; row < rows; row += 1) {
    for (let column = 0; column < across; column += 1) {
      const at = row * across + column;
      if (!levels[at]) continue;
      if (column + 1 < across && levels[at + 1]) {
        joins.right[at] = toRight ? toRight(row * (across - 1) + column) : 1;
      }
      if (row + 1 < rows && levels[at + across]) joins.down[at] = below ? below(at) : 1;
    }
  }
  return joins;
}

/**
 * Middle and half the diagonal of what nearly all points lie in: a few may lie far off. It is turned about the mean
 * depth, for what has a rim and a hill is seen by its rim.
 */
function box(points, depth) {
  const solved = depth.reduce((sum, z) => sum + !Number.isNaN(z), 0);
  const middle = [0, 0, 0];
  let squares = 0;
  for (let axis = 0; solved && axis < 3; axis += 1) {
    const values = new Float64Array(solved);
    let end = 0;
    for (let at = 0; at < depth.length; at += 1) {
      if (!Number.isNaN(depth[at])) values[end++] = points[3 * at + axis];
    }
    values.sort();
    const aside = Math.floor(solved / 400);
    const [low, high] = [values[aside], values[solved - 1 - aside]];
    const kept = values.subarray(aside, solved - aside);
    middle[axis] = axis < 2 ? (low + high) / 2 : kept.reduce((sum, value) => sum + value, 0) / kept.length;
    squares += Math.max(high - middle[axis], middle[axis] - low) ** 2;
  }
  return { middle, half: Math.sqrt(squares) || 1 };
}

/** Normals towards the camera, (p, q, -w), from the slopes of the log depth: see normals in geometry.py. */
function normals(depth, x, y, { right, down }, rows, across) {
  const found = new Float32Array(3 * rows * across);
  const log = depth.map(Math.log);
  const slope = (at, step, before, after, places, place) => {
    const low = before ? at - step : at;
    const high = after ? at + step : at;
    if (low === high) return 0;
    return (log[high] - log[low]) / (places[place + (after ? 1 : 0)] - places[place - (before ? 1 : 0)]);
  };
  for (let row = 0; row < rows; row += 1) {
    for (let column = 0; column < across; column += 1) {
      const at = row * across + column;
      if (Number.isNaN(depth[at])) continue;
      const p = slope(at, 1, column > 0 && right[at - 1], right[at], x, column);
      const q = slope(at, across, row > 0 && down[at - across], down[at], y, row);
      const w = 1 + x[column] * p + y[row] * q;
      const length = Math.hypot(p, q, w);
      found.set([p / length, -q / length, w / length], 3 * at);
    }
  }
  return found;
}

/** Two triangles where four neighbours are joined, one where three are: see mesh in geometry.py. */
function triangles({ right, down }, rows, across) {
  const corners = new Uint16Array(6 * Math.max(0, (rows - 1) * (across - 1)));
  let end = 0;
  const add = (...three) => {
    corners.set(three, end);
    end += 3;
  };
  for (let row = 0; row + 1 < rows; row += 1) {
    for (let column = 0; column + 1 < across; column += 1) {
      const a = row * across + column;
      const [b, c, d] = [a + 1, a + across, a + across + 1];
      const [top, bottom, left, far] = [right[a], right[c], down[a], down[b]];
      if (top && left) add(a, c, b);
      if (bottom && far) add(b, c, d);
      if (!(top && left) && !(bottom && far)) {
        if (bottom && left) add(a, c, d);
        else if (top && far) add(a, d, b);
      }
    }
  }
  return corners.subarray(0, end);
}
