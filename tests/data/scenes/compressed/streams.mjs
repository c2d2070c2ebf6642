// Streams of meshoptimizer's encoder and what its decoder makes of them.
import { MeshoptEncoder as E, MeshoptDecoder as D } from 'meshoptimizer';
import { writeFileSync } from 'fs'; import { createHash } from 'crypto';
await E.ready; await D.ready;
let seed = 1; const random = () => (seed = (seed * 1103515245 + 12345) & 0x7fffffff) / 0x7fffffff;
const hex = a => Buffer.from(a).toString('hex');
const lines = [];
function add(mode, filter, stride, count, source, version) {
  const encoded = version === undefined ? E.encodeGltfBuffer(source, count, stride, mode) : E.encodeGltfBuffer(source, count, stride, mode, version);
  const decoded = new Uint8Array(count * stride);
  D.decodeGltfBuffer(decoded, count, stride, encoded, mode, filter);
  lines.push([mode, filter, stride, count, hex(encoded), filter == 'NONE' ? createHash('sha256').update(decoded).digest('hex') : hex(decoded)].join(' '));
}
for (const version of [0, 1]) {
  for (const [stride, count, step] of [[4, 1, 9], [4, 40, 1], [8, 33, 300], [12, 100, 3], [16, 17, 1e9], [40, 300, 2]]) {
    const source = new Uint8Array(stride * count);
    const view = new DataView(source.buffer);
    for (let k = 0; k < stride / 4; k++) { let v = k * 1000; for (let i = 0; i < count; i++) { v += Math.floor((random() - 0.3) * step); if (k % 3 == 1) view.setFloat32(i * stride + 4 * k, v * 0.125, true); else view.setInt32(i * stride + 4 * k, v | 0, true); } }
    add('ATTRIBUTES', 'NONE', stride, count, source, version);
  }
}
const n = 20, vec = new Float32Array(4 * n);
for (let i = 0; i < n; i++) { const v = [random()-0.5, random()-0.5, random()-0.5, random()-0.5], l = Math.hypot(...v.slice(0, 3)); v.forEach((x, k) => vec[4*i+k] = x / l); }
add('ATTRIBUTES', 'OCTAHEDRAL', 4, n, E.encodeFilterOct(vec, n, 4, 8));
add('ATTRIBUTES', 'OCTAHEDRAL', 8, n, E.encodeFilterOct(vec, n, 8, 12));
for (let i = 0; i < n; i++) { const l = Math.hypot(...vec.slice(4*i, 4*i+4)); for (let k = 0; k < 4; k++) vec[4*i+k] /= l; }
add('ATTRIBUTES', 'QUATERNION', 8, n, E.encodeFilterQuat(vec, n, 8, 14));
for (const mode of ['Separate', 'SharedVector', 'SharedComponent', 'Clamped']) add('ATTRIBUTES', 'EXPONENTIAL', 12, n, E.encodeFilterExp(vec.slice(0, 3*n).map((x, i) => x * 10 ** (i % 9 - 4)), n, 12, 15, mode));
if (E.encodeFilterColor) for (const stride of [4, 8]) add('ATTRIBUTES', 'COLOR', stride, n, E.encodeFilterColor(vec.map(Math.abs), n, stride, stride == 4 ? 8 : 12), 1);
const faces = []; for (let i = 0; i < 6; i++) for (let j = 0; j < 6; j++) { const a = 10*i+j; faces.push(a, a+1, a+10, a+10, a+1, a+11); }
for (let i = 0; i < 60; i++) faces.push(Math.floor(random()*100), Math.floor(random()*100), 100 + Math.floor(random()*900));
for (const stride of [2, 4]) {
  const Array = stride == 2 ? Uint16Array : Uint32Array;
  add('TRIANGLES', 'NONE', stride, faces.length, new Uint8Array(new Array(faces).buffer));
  add('INDICES', 'NONE', stride, 101, new Uint8Array(new Array(faces.slice(0, 101)).buffer));
}
writeFileSync('streams.txt', lines.join('\n') + '\n');
console.log(lines.map(l => l.slice(0, 40)).join('\n'));
