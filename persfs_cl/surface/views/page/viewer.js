// One canvas for all reliefs: WebGL draws the one that is shown, whenever something has changed.

const SHADERS = {
  vertex: `
    attribute vec3 point, normal;
    attribute vec2 place;
    uniform mat3 turned;
    uniform vec4 lens;   // scale across and down, distance of the eye, nearest distance that is drawn
    uniform vec2 moved;
    varying vec3 facing, seen;
    varying vec2 worn;
    void main() {
      vec3 at = turned * point - vec3(0.0, 0.0, lens.z);
      facing = turned * normal;
      seen = at;
      worn = place;
      // Depth from 0 to 1 between the nearest distance and twice that of the eye.
      float far = 2.0 * lens.z + 4.0;
      float z = (-at.z * (far + lens.w) - 2.0 * far * lens.w) / (far - lens.w);
      gl_Position = vec4(at.xy * lens.xy + moved * -at.z, z, -at.z);
    }`,
  fragment: `
    precision mediump float;
    uniform sampler2D photo;
    uniform float bare;
    varying vec3 facing, seen;
    varying vec2 worn;
    void main() {
      vec3 view = normalize(-seen);
      vec3 normal = normalize(facing);
      // Whether one looks at the side that the camera saw: not told by the normal, which is a mean of several.
      float side = gl_FrontFacing ? 1.0 : -1.0;
      normal *= side;
      vec3 lamp = normalize(vec3(-0.55, 0.60, 0.58));
      float lit = 0.5 + 0.5 * dot(normal, lamp);
      float shine = pow(max(dot(normal, normalize(lamp + view)), 0.0), 32.0);
      float diffuse = 0.12 + 0.88 * lit * sqrt(lit);
      vec3 clay = vec3(0.93, 0.89, 0.84) * diffuse + 0.08 * shine;
      vec3 back = vec3(0.36, 0.42, 0.52) * diffuse;
      vec3 front = mix(texture2D(photo, worn).rgb, clay, bare);
      gl_FragColor = vec4(side > 0.0 ? front : back, 1.0);
    }`,
};
const OPENING = { yaw: 28, pitch: 24, zoom: 1, x: 0, y: 0 };
const FRONT = { ...OPENING, yaw: 0, pitch: 0 };
const TANGENT = Math.tan((13 * Math.PI) / 180); // of half the view
const EYE = 1.02 / Math.sin(Math.atan(TANGENT)); // from where all of the box is seen

class Viewer {
  /** `changed` is called when the view or what is worn is another. */
  constructor(canvas, changed) {
    this.canvas = canvas;
    this.changed = changed;
    this.view = { ...OPENING };
    this.wear = "photo";
    this.shown = null;
    this.pending = false;
    this.prepare();
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => {
      this.prepare();
      if (this.shown) this.fill(this.shown);
    });
    new ResizeObserver(() => this.redraw()).observe(canvas);
    new Gestures(canvas, this);
  }

  /** Whether this machine can draw. */
  get able() {
    return Boolean(this.gl);
  }

  prepare() {
    const gl = this.canvas.getContext("webgl", { alpha: true, antialias: true });
    this.gl = gl;
    if (!gl) return;
    const program = gl.createProgram();
    for (const [kind, source] of Object.entries(SHADERS)) {
      const shader = gl.createShader(kind === "vertex" ? gl.VERTEX_SHADER : gl.FRAGMENT_SHADER);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      this.gl = null;
      return;
    }
    gl.useProgram(program);
    this.uniforms = Object.fromEntries(
      ["turned", "lens", "moved", "bare"].map((name) => [name, gl.getUniformLocation(program, name)]),
    );
    this.buffers = {};
    for (const [name, size] of [["point", 3], ["normal", 3], ["place", 2]]) {
      this.buffers[name] = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name]);
      const place = gl.getAttribLocation(program, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, 0, 0);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const [name, value] of [
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
      [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
    ]) gl.texParameteri(gl.TEXTURE_2D, name, value);
    gl.enable(gl.DEPTH_TEST);
  }

  /** Show the surface that a script handed over, and its photograph; null shows nothing. */
  async show(heights) {
    this.shown = null;
    this.redraw();
    if (!heights) return;
    const photo = new Image();
    photo.src = heights.photo;
    await photo.decode();
    this.fill({ ...triangulated(heights), photo });
  }

  fill(shown) {
    const { gl } = this;
    for (const [name, values] of [["point", shown.points], ["normal", shown.normals], ["place", shown.places]]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name]);
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    }
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, shown.triangles, gl.STATIC_DRAW);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, gl.RGB, gl.UNSIGNED_BYTE, shown.photo);
    this.shown = shown;
    this.redraw();
  }

  /** Change the view in some respects, within what makes sense. */
  look(change) {
    const view = { ...this.view, ...change };
    view.yaw = ((((view.yaw + 180) % 360) + 360) % 360) - 180;
    view.pitch = Math.min(Math.max(view.pitch, -90), 90);
    view.zoom = Math.min(Math.max(view.zoom, 0.3), 20);
    this.view = view;
    this.redraw();
    this.changed();
  }

  put(wear) {
    this.wear = wear === "bare" ? "bare" : "photo";
    this.redraw();
    this.changed();
  }

  /** Draw before the next frame; once, however often it is asked for. */
  redraw() {
    if (this.pending || !this.gl) return;
    this.pending = true;
    requestAnimationFrame(() => {
      this.pending = false;
      this.draw();
    });
  }

  draw() {
    const { gl, canvas, uniforms, view } = this;
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth * scale, canvas.clientHeight * scale].map(Math.round);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (!this.shown || !width || !height) return;
    const smaller = Math.min(width, height);
    const lens = (view.zoom * 1.08) / TANGENT;
    gl.uniformMatrix3fv(uniforms.turned, false, rotation(view));
    gl.uniform4f(uniforms.lens, (lens * smaller) / width, (lens * smaller) / height, EYE, 0.05 * EYE);
    gl.uniform2f(uniforms.moved, (view.x * smaller) / width, (view.y * smaller) / height);
    gl.uniform1f(uniforms.bare, this.wear === "bare" ? 1 : 0);
    gl.drawElements(gl.TRIANGLES, this.shown.triangles.length, gl.UNSIGNED_SHORT, 0);
  }
}

/** About the upright axis first, then towards the viewer; column by column, as WebGL takes it. */
function rotation({ yaw, pitch }) {
  const [a, b] = [yaw, pitch].map((degrees) => (degrees * Math.PI) / 180);
  const [ca, sa, cb, sb] = [Math.cos(a), Math.sin(a), Math.cos(b), Math.sin(b)];
  return [ca, sa * sb, -sa * cb, 0, cb, sb, sa, -ca * sb, ca * cb];
}

// Mouse, touch and keyboard turn, move and zoom.
class Gestures {
  constructor(canvas, viewer) {
    this.canvas = canvas;
    this.viewer = viewer;
    this.pointers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => this.pointers.delete(event.pointerId));
    }
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("dblclick", () => viewer.look(OPENING));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const [across, down] = [now[0] - before[0], now[1] - before[1]];
    const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
    this.pointers.set(event.pointerId, now);
    const { view } = this.viewer;
    const unit = Math.min(this.canvas.clientWidth, this.canvas.clientHeight) / 2;
    if (other) {
      // Two fingers: what is between them follows.
      const distance = ([x, y]) => Math.hypot(x - other[0], y - other[1]) || 1;
      const zoom = (view.zoom * distance(now)) / distance(before);
      this.viewer.look({ zoom, x: view.x + across / 2 / unit, y: view.y - down / 2 / unit });
    } else if (event.shiftKey || event.buttons & 6) {
      this.viewer.look({ x: view.x + across / unit, y: view.y - down / unit });
    } else {
      this.viewer.look({ yaw: view.yaw + across * 0.4, pitch: view.pitch + down * 0.4 });
    }
  }

  wheel(event) {
    event.preventDefault();
    const steps = event.deltaY * (event.deltaMode === 1 ? 16 : event.deltaMode === 2 ? 400 : 1);
    this.viewer.look({ zoom: this.viewer.view.zoom * Math.exp(-steps * 0.0015) });
  }

  key(event) {
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    const { viewer } = this;
    const { yaw, pitch, zoom, x, y } = viewer.view;
    const turns = {
      ArrowLeft: { yaw: yaw - 5 }, ArrowRight: { yaw: yaw + 5 }, ArrowUp: { pitch: pitch - 5 },
      ArrowDown: { pitch: pitch + 5 },
    };
    const moves = {
      ArrowLeft: { x: x - 0.05 }, ArrowRight: { x: x + 0.05 }, ArrowUp: { y: y + 0.05 }, ArrowDown: { y: y - 0.05 },
    };
    const change = {
      ...(event.shiftKey ? moves : turns), "+": { zoom: zoom * 1.15 }, "=": { zoom: zoom * 1.15 },
      "-": { zoom: zoom / 1.15 }, 0: OPENING, Home: OPENING, f: FRONT,
    }[event.key];
    if (change) viewer.look(change);
    else if (event.key.toLowerCase() === "w") viewer.put(viewer.wear === "bare" ? "photo" : "bare");
    else return;
    event.preventDefault();
  }
}
