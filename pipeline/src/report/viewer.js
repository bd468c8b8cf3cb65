"use strict";
// Points and cameras in WebGL: drag to turn, wheel or pinch to come nearer, right drag or shift to move.
(() => {
  const scene = JSON.parse(document.getElementById("scene").textContent);
  const canvas = document.querySelector("#view canvas");
  const note = document.getElementById("view-note");
  const controls = document.getElementById("controls");
  const gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) { note.textContent = "This browser shows no WebGL: open the PLY files instead."; return; }

  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const program = (vertex, fragment) => {
    const p = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const s = gl.createShader(kind);
      gl.shaderSource(s, source); gl.compileShader(s);
      if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(s));
      gl.attachShader(p, s);
    }
    gl.bindAttribLocation(p, 0, "place"); gl.bindAttribLocation(p, 1, "colour");
    gl.linkProgram(p);
    return p;
  };
  const draw = program(
    `attribute vec3 place; attribute vec3 colour; uniform mat4 view; uniform float extents; uniform float size; varying vec3 tint;
     void main() { gl_Position = view * vec4(place * extents, 1.0); gl_PointSize = max(1.0, size / gl_Position.w); tint = colour; }`,
    `precision mediump float; varying vec3 tint; void main() { gl_FragColor = vec4(tint, 1.0); }`);
  const buffer = (data) => { const b = gl.createBuffer(); gl.bindBuffer(gl.ARRAY_BUFFER, b); gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW); return b; };

  const sets = scene.sets.map((set) => {
    const words = new Uint16Array(bytes(set.positions).buffer);
    const places = Float32Array.from(words, (w) => w / 65535 * 2 - 1);
    return { ...set, places: buffer(places), tints: buffer(bytes(set.colours)), visible: true };
  });
  sets.forEach((set, i) => { set.visible = i === 0; });

  const glyph = { size: 0.06, visible: true, count: 0 };
  const glyphPlaces = gl.createBuffer(), glyphTints = gl.createBuffer();
  const buildGlyphs = () => {
    const places = [], tints = [];
    for (const c of scene.cameras) {
      const at = (x, y, z) => [0, 1, 2].map((i) => c.centre[i] + glyph.size * (c.axes[i] * x + c.axes[3 + i] * y + c.axes[6 + i] * z));
      const [w, h] = c.half;
      const o = at(0, 0, 0), corners = [at(-w, -h, 1), at(w, -h, 1), at(w, h, 1), at(-w, h, 1)];
      for (let i = 0; i < 4; i++) {
        for (const p of [o, corners[i], corners[i], corners[(i + 1) % 4]]) { places.push(...p); tints.push(255, 140, 40); }
      }
    }
    glyph.count = places.length / 3;
    gl.bindBuffer(gl.ARRAY_BUFFER, glyphPlaces); gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(places), gl.STATIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, glyphTints); gl.bufferData(gl.ARRAY_BUFFER, new Uint8Array(tints), gl.STATIC_DRAW);
  };
  buildGlyphs();

  // The first view looks along the mean direction of the cameras, with their mean up as up.
  const sub = (a, b) => a.map((v, i) => v - b[i]), dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => { const n = Math.hypot(...a) || 1; return a.map((v) => v / n); };
  let forward = [0, 0, 1], up = [0, -1, 0];
  if (scene.cameras.length) {
    forward = [0, 0, 0]; up = [0, 0, 0];
    for (const c of scene.cameras) for (let i = 0; i < 3; i++) { forward[i] += c.axes[6 + i]; up[i] -= c.axes[3 + i]; }
    if (Math.hypot(...forward) < 1e-3) forward = scene.cameras[0].axes.slice(6, 9);
    if (Math.hypot(...up) < 1e-3) up = scene.cameras[0].axes.slice(3, 6).map((v) => -v);
    forward = unit(forward);
  }
  up = unit(sub(up, forward.map((v) => v * dot(up, forward))));
  // Far enough to have the cameras in view, unless some of them are very far.
  const behind = scene.cameras.map((c) => 0.5 - dot(c.centre, forward));
  const start = { forward, up, target: [0, 0, 0], distance: Math.min(8, Math.max(2.4, ...behind)) };
  let eye = structuredClone(start), pointSize = 3;

  const rotate = (v, axis, angle) => {
    const c = Math.cos(angle), s = Math.sin(angle), k = cross(axis, v), d = dot(axis, v) * (1 - c);
    return v.map((x, i) => x * c + k[i] * s + axis[i] * d);
  };
  const matrix = () => {
    const f = eye.forward, s = unit(cross(f, eye.up)), u = cross(s, f);
    const p = eye.target.map((t, i) => t - f[i] * eye.distance);
    const near = eye.distance / 100, far = eye.distance * 20 + 10, g = 1.6, aspect = canvas.width / canvas.height;
    const row = (a, k) => [a[0] * k, a[1] * k, a[2] * k, -dot(a, p) * k];
    const rx = row(s, g / aspect), ry = row(u, g), rw = row(f, 1), a = (far + near) / (far - near), b = -2 * far * near / (far - near);
    const rz = [rw[0] * a, rw[1] * a, rw[2] * a, rw[3] * a + b], m = [rx, ry, rz, rw], out = new Float32Array(16);
    for (let r = 0; r < 4; r++) for (let c = 0; c < 4; c++) out[c * 4 + r] = m[r][c];
    return out;
  };
  let queued = false;
  const paint = () => {
    queued = false;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    canvas.width = canvas.clientWidth * ratio; canvas.height = canvas.clientHeight * ratio;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0.05, 0.106, 0.149, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT); gl.enable(gl.DEPTH_TEST);
    gl.useProgram(draw);
    gl.uniformMatrix4fv(gl.getUniformLocation(draw, "view"), false, matrix());
    gl.uniform1f(gl.getUniformLocation(draw, "size"), pointSize * ratio * eye.distance);
    gl.enableVertexAttribArray(0); gl.enableVertexAttribArray(1);
    const put = (places, tints, extents, mode, count) => {
      gl.uniform1f(gl.getUniformLocation(draw, "extents"), extents);
      gl.bindBuffer(gl.ARRAY_BUFFER, places); gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      gl.bindBuffer(gl.ARRAY_BUFFER, tints); gl.vertexAttribPointer(1, 3, gl.UNSIGNED_BYTE, true, 0, 0);
      gl.drawArrays(mode, 0, count);
    };
    for (const set of sets) if (set.visible) put(set.places, set.tints, set.extents, gl.POINTS, set.shown);
    if (glyph.visible && glyph.count) put(glyphPlaces, glyphTints, 1, gl.LINES, glyph.count);
  };
  const queue = () => { if (!queued) { queued = true; requestAnimationFrame(paint); } };

  const pointers = new Map();
  const spread = () => { const [a, b] = [...pointers.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); pointers.set(e.pointerId, { x: e.clientX, y: e.clientY }); });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (e) => pointers.delete(e.pointerId));
  canvas.addEventListener("pointermove", (e) => {
    const last = pointers.get(e.pointerId);
    if (!last) return;
    const dx = e.clientX - last.x, dy = e.clientY - last.y, before = pointers.size === 2 ? spread() : 0;
    pointers.set(e.pointerId, { x: e.clientX, y: e.clientY });
    if (pointers.size === 2) { eye.distance *= before / (spread() || 1); return queue(); }
    const side = unit(cross(eye.forward, eye.up));
    if (e.shiftKey || (e.buttons & 6)) {
      const k = eye.distance * 1.2 / canvas.clientHeight;
      eye.target = eye.target.map((t, i) => t - side[i] * dx * k + eye.up[i] * dy * k);
    } else {
      eye.forward = unit(rotate(rotate(eye.forward, eye.up, -dx * 0.006), side, -dy * 0.006));
      eye.up = unit(cross(unit(cross(eye.forward, rotate(eye.up, side, -dy * 0.006))), eye.forward));
    }
    queue();
  });
  canvas.addEventListener("wheel", (e) => { e.preventDefault(); eye.distance *= Math.exp(e.deltaY * 0.001); queue(); }, { passive: false });
  canvas.addEventListener("dblclick", () => { eye = structuredClone(start); queue(); });
  canvas.addEventListener("keydown", (e) => {
    const side = unit(cross(eye.forward, eye.up)), step = 0.1;
    if (e.key === "ArrowLeft") eye.forward = unit(rotate(eye.forward, eye.up, step));
    else if (e.key === "ArrowRight") eye.forward = unit(rotate(eye.forward, eye.up, -step));
    else if (e.key === "ArrowUp" || e.key === "ArrowDown") {
      const angle = e.key === "ArrowUp" ? step : -step;
      eye.forward = unit(rotate(eye.forward, side, angle)); eye.up = unit(rotate(eye.up, side, angle));
    } else if (e.key === "+") eye.distance /= 1.1; else if (e.key === "-") eye.distance *= 1.1; else return;
    e.preventDefault(); queue();
  });

  const control = (text, input) => { const label = document.createElement("label"); label.append(input, " " + text); controls.append(label); };
  const box = (text, on, change) => {
    const input = document.createElement("input");
    input.type = "checkbox"; input.checked = on;
    input.addEventListener("change", () => { change(input.checked); queue(); });
    control(text, input);
  };
  const slider = (text, value, min, max, change) => {
    const input = document.createElement("input");
    Object.assign(input, { type: "range", min, max, step: (max - min) / 100, value });
    input.addEventListener("input", () => { change(Number(input.value)); queue(); });
    control(text, input);
  };
  const thousands = (n) => n.toLocaleString("en");
  for (const set of sets) {
    const thinned = set.shown < set.total ? `, ${thousands(set.shown)} shown` : "";
    box(`${set.name} (${thousands(set.total)} points${thinned})`, set.visible, (on) => { set.visible = on; });
  }
  if (scene.cameras.length) box(`cameras (${scene.cameras.length})`, true, (on) => { glyph.visible = on; });
  slider("point size", pointSize, 1, 10, (v) => { pointSize = v; });
  slider("camera size", glyph.size, 0.01, 0.3, (v) => { glyph.size = v; buildGlyphs(); });
  note.textContent = `Drag to turn, wheel to come nearer, shift and drag to move, double click to start over. Half width of the scene: ${scene.half.toPrecision(3)} ${scene.unit}`;
  new ResizeObserver(queue).observe(canvas);
  queue();
})();
