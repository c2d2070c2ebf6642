// Makes plain.glb: a bumpy ground, and five balls of one mesh.
import { Document, NodeIO } from '@gltf-transform/core';
const doc = new Document();
const buffer = doc.createBuffer();
function mesh(name, nu, nv, point, wrap, color) {
  const p = [], n = [], t = [], idx = [];
  for (let i = 0; i <= nu; i++) for (let j = 0; j <= nv; j++) {
    const u = i / nu, v = j / nv, e = 1e-4;
    const at = point(u, v), a = point(u + e, v), b = point(u - e, v), c = point(u, v + e), d = point(u, v - e);
    const du = a.map((x, k) => x - b[k]), dv = c.map((x, k) => x - d[k]);
    let m = [du[1]*dv[2]-du[2]*dv[1], du[2]*dv[0]-du[0]*dv[2], du[0]*dv[1]-du[1]*dv[0]];
    let l = Math.hypot(...m);
    if (l < 1e-14) { m = [0, at[1] > 0 ? 1 : -1, 0]; l = 1; }
    p.push(...at); n.push(...m.map(x => x / l)); t.push(u, v);
  }
  for (let i = 0; i < nu; i++) for (let j = 0; j < nv; j++) {
    const a = i * (nv + 1) + j, b = a + nv + 1;
    idx.push(a, a + 1, b, b, a + 1, b + 1);
  }
  const flip = k => { for (let i = 0; i < k.length; i += 3) [k[i], k[i+1]] = [k[i+1], k[i]]; };
  if (wrap) flip(idx); else flip(idx);
  const acc = (a, type) => doc.createAccessor().setArray(a).setType(type).setBuffer(buffer);
  const prim = doc.createPrimitive()
    .setIndices(acc(new Uint16Array(idx), 'SCALAR'))
    .setAttribute('POSITION', acc(new Float32Array(p), 'VEC3'))
    .setAttribute('NORMAL', acc(new Float32Array(n), 'VEC3'))
    .setAttribute('TEXCOORD_0', acc(new Float32Array(t), 'VEC2'))
    .setMaterial(doc.createMaterial(name + '_paint').setBaseColorFactor(color).setRoughnessFactor(0.9).setMetallicFactor(0));
  return doc.createMesh(name).addPrimitive(prim);
}
const ground = mesh('ground', 14, 14, (u, v) => [20*(u-0.5), 0.4*Math.sin(9*u)*Math.cos(7*v) - 1.5, -20*(v-0.5)], false, [0.3, 0.5, 0.2, 1]);
const ball = mesh('ball', 12, 8, (u, v) => { const a = 2*Math.PI*u, b = Math.PI*(v-0.5); return [0.8*Math.cos(b)*Math.cos(a), 1.2*Math.sin(b), -0.8*Math.cos(b)*Math.sin(a)]; }, true, [0.8, 0.2, 0.1, 1]);
const scene = doc.createScene('world');
scene.addChild(doc.createNode('Ground').setMesh(ground));
for (let i = 0; i < 5; i++) {
  const a = i * 1.2, half = 0.3 * i;
  scene.addChild(doc.createNode('Ball').setMesh(ball).setTranslation([5*Math.cos(a), 0.2*i - 0.5, -5*Math.sin(a)])
    .setRotation([Math.sin(half), 0, 0, Math.cos(half)]).setScale([1 + 0.1*i, 1, 1.3 - 0.1*i]));
}
await new NodeIO().write('plain.glb', doc);
