// SPDX-License-Identifier: MIT
// Mode shapes that move, on a canvas. No library: three.js would add 700 kB to every report, and WebGL neither prints nor gives
// an SVG; lines and flat surfaces need no more than this. Needs structure.js and pens.js.
//
//   const view = okidShapes(canvas, {nodes, lines, surfaces, fixed, dofs, names}, shapes);
//
// nodes     [[x, y, z], ...]         metres or anything else, z is up
// lines     [[1, 2], ...]            pairs of nodes, counted from 1
// surfaces  [[1, 2, 3], ...]         three nodes or more in their order around; optional
// fixed     [1, ...]                 nodes that stay at rest; optional
// dofs      [[node, "x"], ...]       one for each entry of a shape: where it is and which way it counts: x y z -x -y -z
//                                    (null: this entry is not on the picture)
// names     ["a1", ...]              one for each entry, written beside its node; optional
// shapes    [{re: [...], im: [...], name: "..."}, ...]   one for each mode; im and name may be missing; null: not measured
//
// view.show(k, other)   mode k, counted from 0, and beside it another one when `other` is given; outside of the list: at rest
// view.play()           move (also the space bar on the canvas); view.pause() stops where it is
// view.set(shapes, geometry)   new shapes of the same or of another geometry (live page); keeps the angle of view
// view.arrows = true    arrows from rest to where each node is
// view.playing, view.mode, view.other, view.motion(k)      what is on; displacements of a mode
// view.paint(pen, width, height, phase)   one picture with any pen of pens.js
//
// A dot is a node with a sensor (small and grey: fixed), a ring one that follows its neighbours (structure.js). The structure fills its half or the
// whole of the canvas at every angle. Drag or arrow keys turn it; + and -, two fingers and the wheel (once the canvas is
// chosen) bring it nearer; Home is the first view. Colours are the CSS variables --ink (names), --muted (at rest), --accent
// (the shape), --paper (rings) of the canvas, read at each frame: a page that turns dark takes the picture with it. Starts at
// rest when the reader asked for less motion (prefers-reduced-motion).
"use strict";

function okidShapes(canvas, geometry, shapes) {
  const PERIOD_S = 1.6, SWING = 0.16; // one turn of the motion; largest displacement over the size of the structure
  const FIRST = { yaw: -0.6, pitch: 0.35, zoom: 1 };
  const context = canvas.getContext("2d");
  let one, motion, known, mode = 0, other = -1, phase = 0, playing = false, arrows = false, before = 0, view = { ...FIRST };
  const held = new Map(); // fingers on the canvas

  function take(given) {
    one = { ...given, nodes: given.nodes.length ? given.nodes : [[0, 0, 0]], surfaces: given.surfaces || [], names: given.names || [] };
    motion = okidMotion(one);
    known = new Map();
    const flat = one.nodes.every((node) => node[1] === one.nodes[0][1]); // a drawing in the x-z plane is best seen from its front
    FIRST.yaw = flat ? 0 : -0.6;
    FIRST.pitch = flat ? 0 : 0.35;
  }

  // Displacements of a mode, its largest scaled to SWING of the structure's size; computed once.
  function moving(k) {
    const shape = shapes[k];
    if (!shape) return null;
    if (!known.has(shape)) {
      const found = motion.of(shape);
      let largest = 0;
      for (let n = 0; n < found.re.length; n += 3) {
        largest = Math.max(largest, Math.hypot(...found.re.subarray(n, n + 3), ...found.im.subarray(n, n + 3)));
      }
      known.set(shape, { ...found, scale: largest > 0 ? (SWING * motion.size) / largest : 0 });
    }
    return known.get(shape);
  }

  // Re(shape exp(i phase)) at every node.
  function moved(found, at) {
    if (!found) return one.nodes;
    const [c, s] = [found.scale * Math.cos(at), found.scale * Math.sin(at)];
    return one.nodes.map((node, n) => node.map((value, axis) => value + c * found.re[3 * n + axis] - s * found.im[3 * n + axis]));
  }

  // Orthographic: turned about z, then tilted; right, up, towards the reader.
  function turned(points) {
    const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
    return points.map(([x, y, z]) => {
      const depth = x * sy + y * cy;
      return [x * cy - y * sy, z * cp + depth * sp, z * sp - depth * cp];
    });
  }

  // Onto a pane: what the structure needs at rest and at all phases of its motion fills it, names included.
  function projection(found, pane) {
    const reach = [0, 1, 2, 3].flatMap((quarter) => turned(moved(found, (quarter * Math.PI) / 2))).concat(turned(one.nodes));
    const span = [0, 1].map((k) => reach.reduce(([low, high], p) => [Math.min(low, p[k]), Math.max(high, p[k])], [Infinity, -Infinity]));
    const [wide, high] = span.map(([low, up]) => Math.max(up - low, 1e-9 * motion.size));
    const free = [pane.width - 56, pane.height - 64], least = 0.02 * motion.size; // room for names and the heading
    const scale = view.zoom * Math.max(1e-9, Math.min(free[0] / Math.max(wide, least), free[1] / Math.max(high, least)));
    const middle = span.map(([low, up]) => (low + up) / 2);
    return (points) => turned(points).map(([x, y, near]) => [
      pane.left + pane.width / 2 + scale * (x - middle[0]), pane.top + pane.height / 2 + 6 - scale * (y - middle[1]), near]);
  }

  // Names of all entries of a node in one line, at its place at rest; written only where no other name stands.
  function labels(pen, points, colour, pane) {
    const written = [], texts = new Map();
    (one.dofs || []).forEach((dof, k) => {
      if (dof && one.names[k]) texts.set(dof[0] - 1, (texts.has(dof[0] - 1) ? texts.get(dof[0] - 1) + ", " : "") + one.names[k]);
    });
    for (const [node, full] of texts) {
      const text = full.length > 24 ? full.slice(0, 23) + "…" : full;
      if (!points[node]) continue;
      const wide = pen.wide(text), x = Math.min(points[node][0] + 8, pane.left + pane.width - wide - 4), y = points[node][1] - 7;
      if (written.some(([a, b, w]) => x < a + w + 4 && a < x + wide + 4 && Math.abs(y - b) < 14)) continue;
      written.push([x, y, wide]);
      pen.text(text, x, y, colour);
    }
  }

  // Shaft and head of an arrow as pairs of points; none where the node hardly moves.
  function arrow(from, to) {
    const [x, y] = [to[0] - from[0], to[1] - from[1]], long = Math.hypot(x, y);
    if (long < 4) return [];
    const head = Math.min(8, 0.5 * long) / long, barb = (side) => [to[0] - head * (x - side * 0.5 * y), to[1] - head * (y + side * 0.5 * x)];
    return [[from, to], [to, barb(1)], [to, barb(-1)]];
  }

  function paintPane(pen, k, pane, at, colour) {
    const found = moving(k), project = projection(found, pane), still = project(one.nodes), now = project(moved(found, at));
    const faces = one.surfaces.map((face) => face.map((node) => now[node - 1])).filter((face) => face.every(Boolean));
    const depth = (face) => face.reduce((all, corner) => all + corner[2], 0) / face.length;
    for (const face of faces.sort((a, b) => depth(a) - depth(b))) pen.face(face, colour.accent, 0.16);
    const joined = (points) => motion.edges.map(([a, b]) => [points[a], points[b]]);
    pen.lines(joined(still), colour.muted, 1, [4, 4]);
    pen.lines(joined(now), colour.accent, faces.length ? 1.6 : 2.5, []);
    if (arrows) pen.lines(still.flatMap((from, n) => arrow(from, now[n])), colour.ink, 1.2, []);
    const radius = one.nodes.length > 60 ? 2 : 4, fixed = new Set(one.fixed || []);
    now.forEach((point, n) => {
      if (fixed.has(n + 1)) pen.dot(point, 0.6 * radius, colour.muted, colour.muted);
      else if (!found || found.measured[n]) pen.dot(point, radius, colour.accent, colour.accent);
      else if (one.nodes.length <= 60) pen.dot(point, 0.7 * radius, colour.paper, colour.accent);
    });
    labels(pen, still, colour.ink, pane);
    if (shapes[k] && shapes[k].name) pen.text(shapes[k].name, pane.left + 10, pane.top + 18, colour.ink);
  }

  function colours() {
    const style = getComputedStyle(canvas), of = (name, instead) => style.getPropertyValue(name).trim() || instead;
    return { ink: of("--ink", "black"), muted: of("--muted", "gray"), accent: of("--accent", "blue"), paper: of("--paper", of("--panel", "white")) };
  }

  function paint(pen, width, height, at) {
    const colour = colours(), both = [mode, ...(shapes[other] ? [other] : [])], upright = both.length > 1 && height > width;
    both.forEach((k, place) => {
      const part = { width: upright ? width : width / both.length, height: upright ? height / both.length : height };
      paintPane(pen, k, { ...part, left: upright ? 0 : place * part.width, top: upright ? place * part.height : 0 }, at, colour);
    });
  }

  function draw() {
    const width = canvas.clientWidth, height = canvas.clientHeight, ratio = window.devicePixelRatio || 1;
    if (!width || !height) return;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    paint(okidPens.canvas(context), width, height, phase);
  }

  function frame(time) {
    if (!playing) return;
    phase = (phase + (2 * Math.PI * Math.min(0.1, (time - before) / 1000)) / PERIOD_S) % (2 * Math.PI);
    before = time;
    draw();
    requestAnimationFrame(frame);
  }

  function changed() {
    canvas.dispatchEvent(new Event("okid-shapes")); // the page may want to change the word on its button
    draw();
  }

  const api = {
    show(k, beside = other) { mode = k; other = beside; if (!playing) phase = 0; changed(); },
    play() {
      if (playing) return;
      playing = true;
      before = performance.now();
      requestAnimationFrame(frame);
      changed();
    },
    pause() { playing = false; changed(); },
    set(others, another) { shapes = others; if (another) take(another); else known = new Map(); draw(); },
    motion: (k) => moving(k),
    paint,
    period: PERIOD_S,
    get arrows() { return arrows; },
    set arrows(on) { arrows = Boolean(on); draw(); },
    get playing() { return playing; },
    get mode() { return mode; },
    get other() { return other; },
    get phase() { return phase; },
  };

  const apart = () => { const [a, b] = [...held.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
  canvas.addEventListener("pointerdown", (event) => {
    held.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener("pointermove", (event) => {
    const from = held.get(event.pointerId);
    if (!from) return;
    const before = held.size === 2 ? apart() : 0;
    held.set(event.pointerId, [event.clientX, event.clientY]);
    if (held.size === 2) zoom(apart() / Math.max(before, 1));
    else turn((event.clientX - from[0]) * 0.01, (event.clientY - from[1]) * 0.01);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => held.delete(event.pointerId));
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return; // the page is scrolled past it
    zoom(Math.exp(-0.0015 * event.deltaY));
    event.preventDefault();
  }, { passive: false });

  function turn(yaw, pitch) {
    view.yaw += yaw;
    view.pitch = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, view.pitch + pitch));
    draw();
  }

  function zoom(factor) {
    view.zoom = Math.max(0.2, Math.min(8, view.zoom * factor));
    draw();
  }

  const keys = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, -0.1), ArrowDown: () => turn(0, 0.1),
    "+": () => zoom(1.15), "-": () => zoom(1 / 1.15),
    Home: () => { view = { ...FIRST }; draw(); }, " ": () => (playing ? api.pause() : api.play()),
  };
  canvas.addEventListener("keydown", (event) => {
    if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    keys[event.key]();
    event.preventDefault();
  });

  take(geometry);
  view = { ...FIRST };
  new ResizeObserver(draw).observe(canvas);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) draw();
  else api.play();
  return api;
}
