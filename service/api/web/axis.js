/**
 * The axes that the plot and the lanes below it share: the same second lies at the same place in both.
 */

export const WINDOW_S = 10;
export const PAD = { top: 24, right: 14, bottom: 26, left: 40 };
const TICKS_G = [0.1, 0.2, 0.5, 1, 2, 5, 10];

/** Return the ticks in [low, high], at most about five, at a round distance. */
export function ticks(low, high) {
  const step = TICKS_G.find((g) => (high - low) / g <= 5.5) ?? TICKS_G.at(-1);
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.max(0, Math.floor(high / step + 1e-9) - first + 1);
  return Array.from({ length: count }, (_, i) => Number(((first + i) * step).toFixed(6)));
}

/** Return the mapping `x` of device time to a canvas so wide, with its right edge at device time `edge`. */
export function timeAxis(edge, width) {
  const right = width - PAD.right;
  const fromS = (edge ?? 0) - WINDOW_S;
  return { fromS, right, x: (s) => PAD.left + ((s - fromS) / WINDOW_S) * (right - PAD.left) };
}

/** Give a canvas as many pixels as the screen has behind it; return its size in CSS pixels. */
export function fit(canvas, context) {
  const { clientWidth: width, clientHeight: height } = canvas;
  const scale = window.devicePixelRatio || 1;
  const [w, h] = [Math.round(width * scale), Math.round(height * scale)];
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
  }
  context.setTransform(scale, 0, 0, scale, 0, 0);
  return { width, height };
}

/** Return the theme's colours of these names, as `canvas` sees them, and its font. */
export function theme(canvas, names) {
  const style = getComputedStyle(canvas);
  const colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  return { ...colours, font: `12px ${style.fontFamily}` };
}
