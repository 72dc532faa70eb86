// A mesh that turns: drag rotates, wheel or pinch zooms, shift-drag moves, double click resets, two clicks measure.

function readMesh(element) {
  const about = JSON.parse(element.dataset.about);
  const text = atob(element.querySelector('script[type="application/octet-stream"]').textContent.trim());
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const { vertices: n, triangles: m } = about;
  const position = new Float32Array(bytes.buffer, 0, 3 * n);
  const index = new Uint32Array(bytes.buffer, 12 * n, 3 * m);
  const pixel = new Uint16Array(bytes.buffer, 12 * (n + m), 2 * n);
  const photograph = new Uint8Array(bytes.buffer, 16 * n + 12 * m, 3 * n);
  return { about, position, index, pixel, photograph, normal: normals(position, index) };
}

function normals(position, index) {
  const sum = new Float32Array(position.length);
  for (let f = 0; f < index.length; f += 3) {
    const a = 3 * index[f], n = cross(difference(position, 3 * index[f + 1], a), difference(position, 3 * index[f + 2], a));
    for (let k = 0; k < 3; k++) for (let i = 0; i < 3; i++) sum[3 * index[f + k] + i] += n[i];
  }
  return sum;
}

// What each entry of the colour menu shows.
const COLOURS = {
  photograph: (mesh) => mesh.photograph,
  range: (mesh) => {
    const { low, high, table } = mesh.about.range, out = new Uint8Array(mesh.position.length);
    for (let i = 0; i < out.length; i += 3) {
      const r = Math.hypot(mesh.position[i], mesh.position[i + 1], mesh.position[i + 2]);
      const level = Math.min(Math.max((r - low) / (high - low), 0), 1) * (table.length - 1);
      const k = Math.min(Math.floor(level), table.length - 2);
      for (let c = 0; c < 3; c++) out[i + c] = table[k][c] + (level - k) * (table[k + 1][c] - table[k][c]);
    }
    return out;
  },
  plaster: (mesh) => new Uint8Array(mesh.position.length).fill(205),
};

const VERTEX = `#version 300 es
in vec3 position, normal, colour;
uniform mat4 view, projection;
out vec3 seen, facing, tint;
void main() {
  vec4 there = view * vec4(position, 1);
  seen = there.xyz; facing = mat3(view) * normal; tint = colour;
  gl_Position = projection * there;
}`;
// A lamp at the viewer's upper left beside a soft light from everywhere; the back side is a little darker.
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 seen, facing, tint;
uniform float relief;
out vec4 colour;
void main() {
  vec3 n = normalize(facing), lamp = normalize(vec3(-.35, .45, 1));
  bool back = dot(n, -seen) < 0.;
  float light = mix(1., .3 + .75 * max(dot(back ? -n : n, lamp), 0.), relief);
  colour = vec4(tint * light * (back ? .72 : 1.), 1);
}`;

function program(gl) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  gl.useProgram(made);
  return made;
}

function feed(gl, made, name, data, normalized) {
  const place = gl.getAttribLocation(made, name);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
  gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, 3, normalized ? gl.UNSIGNED_BYTE : gl.FLOAT, normalized, 0, 0);
}

// Rotation about the screen's axes: 3 x 3, rows.
function turned(rotation, dx, dy) {
  const [cx, sx, cy, sy] = [Math.cos(dy), Math.sin(dy), Math.cos(dx), Math.sin(dx)];
  const step = [[cy, 0, sy], [sx * sy, cx, -sx * cy], [-cx * sy, sx, cx * cy]];
  return step.map((row) => [0, 1, 2].map((j) => row[0] * rotation[0][j] + row[1] * rotation[1][j] + row[2] * rotation[2][j]));
}

const START = turned([[1, 0, 0], [0, 1, 0], [0, 0, 1]], -0.35, 0.25);
const HALF_FIELD = Math.tan((20 * Math.PI) / 180);

function viewer(element) {
  const canvas = element.querySelector("canvas"), gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) return void (element.querySelector(".reading").textContent = "This browser has no WebGL 2; open mesh.glb instead.");
  const mesh = readMesh(element), { centre, radius } = mesh.about, made = program(gl);
  const home = () => ({ rotation: START, away: (1.1 * radius) / Math.sin(Math.atan(HALF_FIELD)), shift: [0, 0] });
  let view = home(), waiting = false;
  feed(gl, made, "position", mesh.position, false);
  feed(gl, made, "normal", mesh.normal, false);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.index, gl.STATIC_DRAW);
  gl.enable(gl.DEPTH_TEST);
  const uniform = (name) => gl.getUniformLocation(made, name);

  function colour() {
    const chosen = element.querySelector("select").value;
    feed(gl, made, "colour", COLOURS[chosen](mesh), true);
    gl.uniform1f(uniform("relief"), chosen === "plaster" ? 1 : 0.6);
    draw();
  }
  const half = () => {
    const aspect = canvas.clientWidth / Math.max(canvas.clientHeight, 1);
    return [HALF_FIELD * Math.max(aspect, 1), HALF_FIELD * Math.max(1 / aspect, 1)];
  };
  // camera frame (y down, z forward) → eye (y up, z backward), turned about the centre
  function toEye(p) {
    const q = [p[0] - centre[0], centre[1] - p[1], centre[2] - p[2]];
    const [x, y, z] = view.rotation.map((row) => dot(row, q));
    return [x + view.shift[0], y + view.shift[1], z - view.away];
  }
  function fromEye(d) {
    const r = view.rotation;
    return [0, 1, 2].map((j) => (j ? -1 : 1) * (r[0][j] * d[0] + r[1][j] * d[1] + r[2][j] * d[2]));
  }
  function draw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      render();
    });
  }
  function render() {
    const dense = window.devicePixelRatio || 1;
    const [width, height] = [Math.round(canvas.clientWidth * dense), Math.round(canvas.clientHeight * dense)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const r = view.rotation, o = toEye([0, 0, 0]), [hx, hy] = half();
    const matrix = [r[0][0], r[1][0], r[2][0], 0, -r[0][1], -r[1][1], -r[2][1], 0, -r[0][2], -r[1][2], -r[2][2], 0, ...o, 1];
    const near = Math.max(view.away - 4 * radius, 0.01 * view.away), far = view.away + 40 * radius;
    const depth = [(far + near) / (near - far), (2 * far * near) / (near - far)];
    gl.uniformMatrix4fv(uniform("view"), false, matrix);
    gl.uniformMatrix4fv(uniform("projection"), false, [1 / hx, 0, 0, 0, 0, 1 / hy, 0, 0, 0, 0, depth[0], -1, 0, 0, depth[1], 0]);
    gl.drawElements(gl.TRIANGLES, mesh.index.length, gl.UNSIGNED_INT, 0);
    tape.place();
    element.dataset.drawnMs = element.dataset.drawnMs || Math.round(performance.now());
  }
  // Where a point of the camera frame is on the page, px of the canvas.
  function onScreen(p) {
    const [x, y, z] = toEye(p), [hx, hy] = half();
    return [(0.5 - (0.5 * x) / (z * hx)) * canvas.clientWidth, (0.5 + (0.5 * y) / (z * hy)) * canvas.clientHeight];
  }
  function pick(x, y) {
    const [hx, hy] = half();
    const towards = [(2 * x / canvas.clientWidth - 1) * hx, (1 - 2 * y / canvas.clientHeight) * hy, -1];
    const eye = fromEye([-view.shift[0], -view.shift[1], view.away]).map((value, i) => value + centre[i]);
    return hit(mesh, eye, fromEye(towards));
  }
  const tape = measuring(element, mesh, onScreen, draw);
  handle(canvas, {
    turn: (dx, dy) => (view.rotation = turned(view.rotation, dx / 160, dy / 160)),
    move: (dx, dy) => {
      const scale = (2 * view.away * half()[1]) / canvas.clientHeight;
      view.shift = [view.shift[0] + dx * scale, view.shift[1] - dy * scale];
    },
    zoom: (factor) => (view.away = Math.min(Math.max(view.away * factor, 0.05 * radius), 30 * radius)),
    reset: () => { view = home(); tape.clear(); },
    click: (x, y) => tape.add(pick(x, y)),
    draw,
  });
  element.querySelector("select").addEventListener("change", colour);
  element.querySelector("button").addEventListener("click", () => { view = home(); tape.clear(); draw(); });
  new ResizeObserver(draw).observe(canvas);
  colour();
}
