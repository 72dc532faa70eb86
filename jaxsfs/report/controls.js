// What the pointer, the wheel and the keys do to a view, and the two points between which it measures.

const STILL = 4; // px: a press that moves less is a click

function handle(canvas, act) {
  const down = new Map();
  let travelled = 0, apart = 0;
  const spread = () => {
    const [a, b] = [...down.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (down.size === 1) travelled = 0;
    if (down.size === 2) apart = spread();
  });
  canvas.addEventListener("pointermove", (event) => {
    const last = down.get(event.pointerId);
    if (!last) return;
    const dx = event.clientX - last.x, dy = event.clientY - last.y;
    down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    travelled += Math.abs(dx) + Math.abs(dy);
    if (down.size === 2) {
      const now = spread();
      act.zoom(apart / Math.max(now, 1));
      act.move(dx / 2, dy / 2);
      apart = now;
      travelled = Infinity;
    } else if (event.shiftKey || event.buttons & 2) act.move(dx, dy);
    else if (travelled > STILL) act.turn(dx, dy);
    act.draw();
  });
  const up = (event) => {
    if (!down.delete(event.pointerId) || event.type !== "pointerup" || travelled > STILL || event.button) return;
    const box = canvas.getBoundingClientRect();
    act.click(event.clientX - box.left, event.clientY - box.top);
  };
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointercancel", up);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("dblclick", () => { act.reset(); act.draw(); });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    act.zoom(Math.exp(0.0012 * event.deltaY));
    act.draw();
  }, { passive: false });
  const keys = {
    ArrowLeft: () => act.turn(-16, 0), ArrowRight: () => act.turn(16, 0),
    ArrowUp: () => act.turn(0, -16), ArrowDown: () => act.turn(0, 16),
    "+": () => act.zoom(0.9), "-": () => act.zoom(1.1), Home: () => act.reset(),
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
    act.draw();
  });
}

// Points A and B, drawn over the canvas, and what lies between them in words.
function measuring(element, mesh, onScreen, draw) {
  const overlay = element.querySelector("svg"), reading = element.querySelector(".reading"), hint = reading.textContent;
  const { unit } = mesh.about, number = (value) => value.toPrecision(4);
  let points = [], path = [];
  const place = () => {
    const drawn = (list) => list.map((p) => onScreen(p).map((x) => x.toFixed(1)).join()).join(" ");
    const ends = points.map((p) => p.point);
    const marks = ends.map((p, i) => {
      const [x, y] = onScreen(p).map((value) => value.toFixed(1));
      return `<circle cx="${x}" cy="${y}" r="4"/><text x="${+x + 8}" y="${y - 8}">${"AB"[i]}</text>`;
    });
    overlay.innerHTML = `<polyline class="surface" points="${drawn(path)}"/><polyline points="${drawn(ends)}"/>${marks.join("")}`;
  };
  const words = ({ point, pixel }, name) => `${name} (${pixel.map((x) => x.toFixed(1))}): range ${number(Math.hypot(...point))} ${unit}`;
  function tell() {
    if (!points.length) return void (reading.textContent = hint);
    const [a, b] = points, said = [words(a, "A")];
    if (b) {
      const along = alongSurface(mesh, a.found, b.found);
      path = along ? along.path : [];
      said.push(words(b, "B"), `straight ${number(distance(a.point, b.point))} ${unit}`);
      said.push(along ? `along the surface ≈ ${number(along.length)} ${unit}` : "no way along the surface: it is cut between them");
      said.push(`jaxsfs measure FOLDER --between ${a.pixel.map((x) => x.toFixed(1))} ${b.pixel.map((x) => x.toFixed(1))}`);
    } else said.push("click a second point");
    reading.textContent = said.join(" · ");
  }
  return {
    place,
    clear() { points = []; path = []; tell(); },
    add(found) {
      if (!found) return;
      if (points.length === 2) { points = []; path = []; }
      points.push({ found, point: at(mesh, mesh.position, 3, found), pixel: at(mesh, mesh.pixel, 2, found) });
      tell();
      draw();
    },
  };
}

document.querySelectorAll(".viewer").forEach(viewer);
