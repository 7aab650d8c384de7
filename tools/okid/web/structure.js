// SPDX-License-Identifier: MIT
// How a structure moves of which some nodes carry sensors: the rule of tools/okid/data/structure_motion.py, in the browser.
//
//   const motion = okidMotion({nodes, lines, surfaces, fixed, dofs});
//   motion.edges        [[a, b], ...]  nodes from 0 that a line or the edge of a surface joins, each pair once
//   motion.of(shape)    {re, im: Float64Array(3 * nodes), measured: [true, ...]}   of one shape {re: [...], im: [...]}
//
// Each axis by itself: a node with a sensor along it moves as measured (null: not measured), a fixed one stays at rest, every
// other one moves as the mean of those it is joined to, weight 1 / length (PLATE times that
// along the edge of a surface); what nothing joins to a sensor stays at rest.
"use strict";

function okidMotion(geometry) {
  const PLATE = 10, nodes = geometry.nodes, count = nodes.length, fixed = new Set((geometry.fixed || []).map((node) => node - 1));
  const seen = new Set(), edges = [], near = nodes.map(() => []);
  const low = [0, 1, 2].map((k) => nodes.reduce((least, n) => Math.min(least, n[k]), Infinity));
  const high = [0, 1, 2].map((k) => nodes.reduce((most, n) => Math.max(most, n[k]), -Infinity));
  const size = Math.hypot(...high.map((value, k) => value - low[k])) || 1;

  function join(one, other, stiff) {
    const a = Math.min(one, other) - 1, b = Math.max(one, other) - 1;
    if (a === b || !nodes[a] || !nodes[b] || seen.has(a * count + b)) return;
    seen.add(a * count + b);
    edges.push([a, b]);
    const weight = stiff / Math.max(Math.hypot(...nodes[a].map((value, k) => value - nodes[b][k])), 1e-6 * size);
    near[a].push([b, weight]);
    near[b].push([a, weight]);
  }
  for (const one of geometry.surfaces || []) one.forEach((node, k) => join(node, one[(k + 1) % one.length], PLATE));
  for (const [a, b] of geometry.lines || []) join(a, b, 1);

  // Nodes that paths of free nodes join to a known one.
  function reached(known) {
    const out = new Set(known), queue = [...known];
    while (queue.length) for (const [next] of near[queue.pop()]) if (!out.has(next)) { out.add(next); queue.push(next); }
    return out;
  }

  // Every free node becomes the mean of its neighbours: conjugate gradients on the weights, scaled by their sums.
  function extend(values, known) {
    const there = reached(known), free = [];
    for (let k = 0; k < count; k++) if (there.has(k) && !known.has(k) && !fixed.has(k)) free.push(k);
    if (!free.length) return;
    const place = new Map(free.map((node, k) => [node, k])), sums = free.map((node) => near[node].reduce((all, [, w]) => all + w, 0));
    const times = (x) => free.map((node, k) => near[node].reduce((all, [b, w]) => all - (place.has(b) ? w * x[place.get(b)] : 0), sums[k] * x[k]));
    const dot = (a, b) => a.reduce((all, one, k) => all + one * b[k], 0);
    let rest = free.map((node) => near[node].reduce((all, [b, w]) => all + (place.has(b) ? 0 : w * values[b]), 0));
    const x = free.map(() => 0), wanted = 1e-22 * dot(rest, rest.map((one, k) => one / sums[k]));
    let scaled = rest.map((one, k) => one / sums[k]), way = scaled, error = dot(rest, scaled);
    for (let step = 0; step < 4 * free.length + 20 && error > wanted; step++) {
      const ahead = times(way), far = error / dot(way, ahead);
      way.forEach((one, k) => { x[k] += far * one; });
      rest = rest.map((one, k) => one - far * ahead[k]);
      scaled = rest.map((one, k) => one / sums[k]);
      const before = error;
      error = dot(rest, scaled);
      way = scaled.map((one, k) => one + (error / before) * way[k]);
    }
    free.forEach((node, k) => { values[node] = x[k]; });
  }

  function of(shape) {
    const out = { re: new Float64Array(3 * count), im: new Float64Array(3 * count), measured: nodes.map(() => false) };
    const known = [new Map(), new Map(), new Map()]; // of each axis: node -> [re, im, how many]
    (geometry.dofs || []).forEach((dof, k) => {
      if (!dof || !nodes[dof[0] - 1] || !Number.isFinite(shape.re[k])) return;
      const axis = "xyz".indexOf(dof[1].slice(-1)), sign = dof[1][0] === "-" ? -1 : 1, node = dof[0] - 1;
      const imaginary = shape.im && Number.isFinite(shape.im[k]) ? shape.im[k] : 0, sum = known[axis].get(node) || [0, 0, 0];
      known[axis].set(node, [sum[0] + sign * shape.re[k], sum[1] + sign * imaginary, sum[2] + 1]);
      out.measured[node] = true;
    });
    known.forEach((sums, axis) => {
      [out.re, out.im].forEach((part, which) => {
        const values = new Float64Array(count);
        for (const [node, sum] of sums) values[node] = sum[which] / sum[2];
        if (sums.size) extend(values, new Set(sums.keys()));
        values.forEach((value, node) => { part[3 * node + axis] = value; });
      });
    });
    return out;
  }

  return { edges, size, of };
}
