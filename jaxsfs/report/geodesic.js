// Where a line of sight meets the mesh, and the way along the surface between two such points.

// The nearest hit of the ray origin + t·direction: {t, triangle, weights} (barycentric), or null. Möller & Trumbore 1997.
function hit(mesh, origin, direction) {
  const { position, index } = mesh;
  let best = null;
  for (let f = 0; f < index.length; f += 3) {
    const a = 3 * index[f], b = 3 * index[f + 1], c = 3 * index[f + 2];
    const e1 = difference(position, b, a), e2 = difference(position, c, a);
    const p = cross(direction, e2), determinant = dot(e1, p);
    if (determinant === 0) continue;
    const s = [origin[0] - position[a], origin[1] - position[a + 1], origin[2] - position[a + 2]];
    const u = dot(s, p) / determinant;
    if (u < 0 || u > 1) continue;
    const q = cross(s, e1), v = dot(direction, q) / determinant, t = dot(e2, q) / determinant;
    if (v < 0 || u + v > 1 || t <= 0 || (best && t >= best.t)) continue;
    best = { t, triangle: f, weights: [1 - u - v, u, v] };
  }
  return best;
}

// A value per vertex (`size` numbers each) at a hit.
function at(mesh, values, size, found) {
  const out = new Array(size).fill(0);
  for (let k = 0; k < 3; k++)
    for (let i = 0; i < size; i++) out[i] += found.weights[k] * values[size * mesh.index[found.triangle + k] + i];
  return out;
}

// Length of the shortest way over the mesh and the points it passes; null where cuts keep the two apart.
// Fast marching over triangles with unfolded point sources: Kimmel & Sethian 1998, Novotni & Klein 2002.
function alongSurface(mesh, from, to) {
  const { position, index } = mesh, count = position.length / 3;
  const start = at(mesh, position, 3, from), end = at(mesh, position, 3, to);
  if (from.triangle === to.triangle) return { length: distance(start, end), path: [start, end] };
  const length = new Float64Array(count).fill(Infinity), before = new Int32Array(count).fill(-1);
  const done = new Uint8Array(count), queue = heap(length);
  for (let k = 0; k < 3; k++) {
    const v = index[from.triangle + k];
    length[v] = distance(start, vertex(position, v));
    queue.push(v);
  }
  const goals = [0, 1, 2].map((k) => index[to.triangle + k]);
  mesh.around = mesh.around || trianglesAround(index, count);
  while (queue.size() && !goals.every((v) => done[v])) {
    const v = queue.pop();
    if (done[v]) continue;
    done[v] = 1;
    for (let i = mesh.around.first[v]; i < mesh.around.first[v + 1]; i++) {
      const f = mesh.around.triangle[i];
      for (let k = 0; k < 3; k++) {
        const c = index[f + k];
        if (done[c]) continue;
        const a = index[f + ((k + 1) % 3)], b = index[f + ((k + 2) % 3)];
        const [reached, via] = updated(position, length, done, a, b, c);
        if (reached < length[c]) {
          length[c] = reached;
          before[c] = via;
          queue.push(c);
        }
      }
    }
  }
  const [a, b, c] = goals;
  const ends = [[a, b], [b, c], [c, a]].map(([p, q]) => unfolded(vertex(position, p), vertex(position, q), end, length[p], length[q]));
  const best = Math.min(...ends, ...goals.map((v) => length[v] + distance(vertex(position, v), end)));
  if (!isFinite(best)) return null;
  const path = [end];
  for (let v = goals.reduce((x, y) => (length[x] < length[y] ? x : y)); v >= 0; v = before[v]) path.push(vertex(position, v));
  return { length: best, path: [...path, start] };
}

// The length at c through the edge a b (or along an edge), and the end of the edge that it came by.
function updated(position, length, done, a, b, c) {
  const pa = vertex(position, a), pb = vertex(position, b), pc = vertex(position, c);
  let best = Infinity, via = -1;
  if (done[a]) [best, via] = [length[a] + distance(pa, pc), a];
  if (done[b] && length[b] + distance(pb, pc) < best) [best, via] = [length[b] + distance(pb, pc), b];
  if (!done[a] || !done[b]) return [best, via];
  const through = unfolded(pa, pb, pc, length[a], length[b]);
  return through < best ? [through, length[a] < length[b] ? a : b] : [best, via];
}

// Distance from the source that is `da` from a and `db` from b, unfolded into the plane of a, b, c, if the straight way
// to c crosses the edge.
function unfolded(a, b, c, da, db) {
  const ab = [b[0] - a[0], b[1] - a[1], b[2] - a[2]], ac = [c[0] - a[0], c[1] - a[1], c[2] - a[2]];
  const edge = Math.hypot(...ab), x = dot(ac, ab) / edge, y = Math.sqrt(Math.max(dot(ac, ac) - x * x, 0));
  const sx = (da * da - db * db + edge * edge) / (2 * edge), sy = -Math.sqrt(Math.max(da * da - sx * sx, 0));
  const crossing = sx + ((x - sx) * -sy) / (y - sy || 1);
  return crossing < 0 || crossing > edge ? Infinity : Math.hypot(x - sx, y - sy);
}

function trianglesAround(index, count) {
  const first = new Uint32Array(count + 1);
  for (const v of index) first[v + 1]++;
  for (let v = 0; v < count; v++) first[v + 1] += first[v];
  const next = first.slice(), triangle = new Uint32Array(index.length);
  for (let i = 0; i < index.length; i++) triangle[next[index[i]]++] = i - (i % 3);
  return { first, triangle };
}

// A binary heap of [key, vertex]; a vertex may be in it several times, the smallest comes out first.
function heap(key) {
  const keys = [], items = [];
  const swap = (i, j) => { [keys[i], keys[j]] = [keys[j], keys[i]]; [items[i], items[j]] = [items[j], items[i]]; };
  return {
    size: () => items.length,
    push(item) {
      let i = items.push(item) - 1;
      keys.push(key[item]);
      for (let up; i && keys[i] < keys[(up = (i - 1) >> 1)]; i = up) swap(i, up);
    },
    pop() {
      swap(0, items.length - 1);
      keys.pop();
      const top = items.pop();
      for (let i = 0; ; ) {
        let least = i;
        for (const child of [2 * i + 1, 2 * i + 2]) if (child < items.length && keys[child] < keys[least]) least = child;
        if (least === i) return top;
        swap(i, least);
        i = least;
      }
    },
  };
}

const vertex = (position, v) => [position[3 * v], position[3 * v + 1], position[3 * v + 2]];
const difference = (p, i, j) => [p[i] - p[j], p[i + 1] - p[j + 1], p[i + 2] - p[j + 2]];
const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
