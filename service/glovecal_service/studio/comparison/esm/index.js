// What charts of a comparison share: colours of the page, light or dark, and the numbers of people.
const LIGHT = ["#1d4ed8", "#c2410c", "#047857", "#7e22ce"];
const DARK = ["#8fb4ff", "#fdba74", "#6ee7b7", "#d8b4fe"];

/** Colours as they are now: of the page, and one a model. */
export function colours() {
  const style = getComputedStyle(document.body);
  const page = (name) => style.getPropertyValue(name).trim();
  const isDark = document.body.classList.contains("body--dark");
  return {
    ink: page("--ink"), line: page("--line"), card: page("--card"), quiet: isDark ? "#9aa7b5" : "#5b6675",
    model: (number) => (isDark ? DARK : LIGHT)[number % LIGHT.length],
  };
}

/** Call `drawn` when the page turns light or dark; answers what ends that. */
export function whenThemeChanges(drawn) {
  const watch = new MutationObserver(drawn);
  watch.observe(document.body, { attributes: true, attributeFilter: ["class"] });
  return () => watch.disconnect();
}

/** An axis of numbers. */
export function axis(shades, more) {
  return {
    type: "value", nameTextStyle: { color: shades.ink }, axisLabel: { color: shades.ink, hideOverlap: true },
    axisLine: { onZero: false, lineStyle: { color: shades.quiet } }, splitLine: { lineStyle: { color: shades.line } }, ...more,
  };
}

/** Degrees with their sign where they are a difference; a dash where there is none. */
export function degrees(value, signed = false) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  return `${signed && value > 0 ? "+" : ""}${value.toFixed(2)}°`;
}
