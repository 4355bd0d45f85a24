/**
 * How each counter's steps look: one shape and one colour by its name, the same in plot, lanes and key.
 *
 * A counter keeps its look whether it is the primary or not. Colours are custom properties of the style sheet; shapes
 * are SVG paths about the origin with a radius of one, which canvas and SVG both draw.
 */

const SHAPES = {
  disc: "M1 0A1 1 0 1 1-1 0A1 1 0 1 1 1 0Z",
  square: "M-.9-.9H.9V.9H-.9Z",
  triangle: "M0-1.15 1.1.85H-1.1Z",
  diamond: "M0-1.3 1.15 0 0 1.3-1.15 0Z",
  wedge: "M0 1.15 1.1-.85H-1.1Z",
  cross: "M-.4-1.2H.4V-.4H1.2V.4H.4V1.2H-.4V.4H-1.2V-.4H-.4Z",
  bar: "M-.45-1.25H.45V1.25H-.45Z",
  star: "M0-1.35.4-.4 1.3-.3.65.35.85 1.25 0 .75-.85 1.25-.65.35-1.3-.3-.4-.4Z",
  hexagon: "M-.6-1.05H.6L1.2 0 .6 1.05H-.6L-1.2 0Z",
};
const ACCELERATION = "Filtered acceleration, g";
const LOOKS = {
  double_threshold: { shape: "disc", colour: "step" },
  autocorrelation: { shape: "square", colour: "mark-sky" },
  adaptive_peak: { shape: "triangle", colour: "mark-amber" },
  gyro_zero_crossing: { shape: "diamond", colour: "mark-rust", signal: "Filtered turning rate, rad/s" },
  fusion: { shape: "cross", colour: "mark-plum" },
  conventional_peak: { shape: "wedge", colour: "mark-indigo" },
  plus_minus: { shape: "bar", colour: "mark-slate" },
  steplink: { shape: "star", colour: "mark-rose" },
};
/** A counter that this page does not know yet. */
const OTHER = { shape: "hexagon", colour: "mark-slate" };

export const COLOURS = [...new Set([...Object.values(LOOKS), OTHER].map(({ colour }) => colour))];

/** Return `{path, colour, signal}` of a counter: its shape, its colour's name, what its signal is. */
export function look(counter) {
  const { shape, colour, signal = ACCELERATION } = Object.hasOwn(LOOKS, counter) ? LOOKS[counter] : OTHER;
  return { path: SHAPES[shape], colour, signal };
}

const paths = new Map();

/** Trace a counter's shape on a canvas at (x, y) and return it, ready to be filled or stroked. */
export function outline(counter, x, y, radius) {
  const { path } = look(counter);
  if (!paths.has(path)) paths.set(path, new Path2D(path));
  const placed = new Path2D();
  placed.addPath(paths.get(path), new DOMMatrix([radius, 0, 0, radius, x, y]));
  return placed;
}

/** Paint a counted step: solid, with a rim of the ground's colour; `alpha` lets it come up. */
export function paintCounted(context, shape, { colour, ground, alpha = 1 }) {
  context.globalAlpha = alpha;
  context.lineWidth = 2;
  context.strokeStyle = ground;
  context.fillStyle = colour;
  context.fill(shape);
  context.stroke(shape);
  context.globalAlpha = 1;
}

/** Paint a likely step: hollow and light, `alpha` of its full presence. */
export function paintLikely(context, shape, { colour, ground, alpha = 1 }) {
  context.globalAlpha = 0.8 * alpha;
  context.lineWidth = 1.5;
  context.fillStyle = ground;
  context.strokeStyle = colour;
  context.fill(shape);
  context.stroke(shape);
  context.globalAlpha = 1;
}

/** Return a counter's name as people read it. */
export function words(name) {
  return name.replaceAll("_", " ");
}
