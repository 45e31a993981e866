// What charts share: their life on a page, the page's colours, light or dark, legends, and the numbers of people.
import { echarts } from "nicegui-echart";

const LIGHT = ["#1d4ed8", "#c2410c", "#047857", "#7e22ce"];
const DARK = ["#8fb4ff", "#fdba74", "#6ee7b7", "#d8b4fe"];

/** Colours as they are now: of the page, and one a model. */
export function colours() {
  const style = getComputedStyle(document.body);
  const page = (name) => style.getPropertyValue(name).trim();
  const isDark = document.body.classList.contains("body--dark");
  return {
    ink: page("--ink"), line: page("--line"), card: page("--card"), quiet: isDark ? "#9aa7b5" : "#5b6675",
    grey: isDark ? "#8b9bb0" : "#64748b", green: isDark ? "#4ade80" : "#15803d", amber: isDark ? "#fbbf24" : "#b45309",
    onBar: isDark ? "#0b1220" : "#ffffff",
    model: (number) => (isDark ? DARK : LIGHT)[number % LIGHT.length],
  };
}

/**
 * A chart's life: drawn into `ref="plot"` when it is mounted, when its document changes and when the page turns
 * light or dark. Its component gives `draw`, and where needed `show` (a new document) and `resized`.
 */
export const chart = {
  props: { document: Object, label: String },
  mounted() {
    this.chart = echarts.init(this.$refs.plot, null, { renderer: "canvas" });
    this.sizes = new ResizeObserver(() => { this.chart.resize(); this.resized(); });
    this.sizes.observe(this.$refs.plot);
    this.theme = new MutationObserver(() => this.draw());
    this.theme.observe(document.body, { attributes: true, attributeFilter: ["class"] });
    this.show();
  },
  beforeUnmount() {
    this.sizes.disconnect();
    this.theme.disconnect();
    this.chart.dispose();
  },
  watch: { document() { this.show(); } },
  methods: {
    show() { this.draw(); },
    resized() {},
  },
};

/** A plot above its legend: [{name, kind, colour}] in `legend`. `plot`: the class of its size. */
export const withLegend = (plot) => ({
  mixins: [chart],
  template: `
    <div>
      <div ref="plot" class="${plot}" role="img" :aria-label="label"></div>
      <ul class="legend">
        <li v-for="one in legend" :key="one.name">
          <span class="legend-swatch" :class="'is-' + one.kind" :style="{ '--swatch': one.colour }" aria-hidden="true"></span>{{ one.name }}
        </li>
      </ul>
    </div>`,
  data: () => ({ legend: [] }),
});

/** What a pointer is told. */
export function tooltip(shades, more) {
  return {
    trigger: "item", renderMode: "richText", confine: true, backgroundColor: shades.card,
    borderColor: shades.line, textStyle: { color: shades.ink }, ...more,
  };
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
