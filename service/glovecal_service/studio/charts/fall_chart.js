// The held-out error step by step: what is left, what each step took away, its control's line, the noise floor.
import { axis, colours, degrees, withLegend } from "glovecal-charts";

export default {
  mixins: [withLegend("fall-plot")],
  props: { pending: Object },
  watch: { pending() { this.draw(); } },
  methods: {
    resized() { this.draw(); },
    draw() {
      if (!this.document) return;
      const { steps, floor } = JSON.parse(JSON.stringify(this.document)), shades = colours();
      const { amber, green, grey } = shades, blue = shades.model(0), next = this.pending;
      const names = [...steps.map((one) => one.label), ...(next ? [next.label] : [])];
      const last = steps.at(-1)?.rmse_deg ?? 0;
      const most = 1.16 * Math.max(...steps.flatMap((one) => [one.rmse_deg, one.control_rmse_deg ?? 0]));
      const width = this.$refs.plot.clientWidth, step = (width - 76) / Math.max(1, names.length);
      const isNarrow = step < 150;
      const saved = steps.map((one, i) => (i ? Math.max(0, steps[i - 1].rmse_deg - one.rmse_deg) : 0));
      const isTall = (i) => i < steps.length && steps[i].rmse_deg > 0.1 * most; // its number fits into its bar
      const hatch = (colour) => ({ symbol: "rect", dashArrayX: [1, 0], dashArrayY: [2, 5], rotation: -Math.PI / 4, color: colour });
      const series = [
        {
          type: "bar", stack: "error", name: "held-out error", barMaxWidth: 84, z: 2, cursor: "default",
          data: [
            ...steps.map((one) => ({ value: one.rmse_deg, itemStyle: { color: one.is_scale ? grey : blue } })),
            ...(next ? [{ value: last, itemStyle: { color: "transparent", borderColor: blue, borderType: "dashed", borderWidth: 2 } }] : []),
          ],
          label: {
            show: true, position: "insideTop", fontWeight: 650, color: shades.onBar, fontSize: step < 80 ? 10 : 12,
            formatter: ({ dataIndex }) => (isTall(dataIndex) ? degrees(steps[dataIndex].rmse_deg) : ""),
          },
        },
        {
          type: "bar", stack: "error", name: "taken away", silent: true, z: 1,
          data: [...saved.map((value) => ({ value, itemStyle: { color: "transparent", decal: hatch(grey), opacity: 0.9, borderColor: grey, borderWidth: value ? 1 : 0 } })), ...(next ? [0] : [])],
          label: {
            show: true, position: "top", color: shades.ink,
            formatter: ({ dataIndex }) => [
              steps[dataIndex] && !isTall(dataIndex) ? degrees(steps[dataIndex].rmse_deg) : "",
              saved[dataIndex] > 0.005 ? `−${saved[dataIndex].toFixed(2)}°` : "",
            ].filter(Boolean).join("  "),
          },
        },
        {
          type: "custom", name: "control", silent: true, z: 5, encode: { x: 0, y: 1 },
          data: steps.flatMap((one, i) => (one.control_rmse_deg === null ? [] : [[i, one.control_rmse_deg]])),
          renderItem: (params, api) => {
            const [x, y] = api.coord([api.value(0), api.value(1)]), half = Math.min(50, 0.4 * step);
            return {
              type: "group", children: [
                { type: "line", shape: { x1: x - half, y1: y, x2: x + half, y2: y }, style: { stroke: amber, lineWidth: 3, lineDash: [7, 4] } },
                { type: "text", style: { text: degrees(api.value(1)), ...(isNarrow ? { x, y: y + 5, align: "center", verticalAlign: "top" } : { x: x - half - 4, y, align: "right", verticalAlign: "middle" }), fill: amber, fontWeight: 650, fontSize: 12, stroke: shades.card, lineWidth: 3 } },
              ],
            };
          },
        },
      ];
      if (next) {
        series.push({
          type: "bar", name: "job", barGap: "-100%", barMaxWidth: 84, z: 3, silent: true,
          data: [...steps.map(() => null), next.fraction * last], itemStyle: { color: blue, opacity: 0.35 },
          label: { show: true, position: "top", color: shades.ink, fontWeight: 650, formatter: `${Math.round(100 * next.fraction)} %` },
        });
      }
      if (floor) {
        series.push({
          type: "line", data: [], silent: true,
          markArea: { silent: true, itemStyle: { color: green, opacity: 0.32 }, z: 4, data: [[{ yAxis: floor.low_deg }, { yAxis: floor.high_deg }]] },
          markLine: { silent: true, symbol: "none", label: { show: false }, lineStyle: { color: green, width: 2, type: "solid" }, data: [{ yAxis: floor.floor_deg }] },
        });
      }
      this.legend = [
        { name: "simpler calibrations", kind: "band", colour: grey },
        { name: "versions", kind: "band", colour: blue },
        ...(steps.some((one) => one.control_rmse_deg !== null) ? [{ name: "with the effect's control in its place", kind: "dashed", colour: amber }] : []),
        ...(floor ? [{ name: `noise floor ${degrees(floor.floor_deg)}, 95 % ${floor.low_deg.toFixed(2)} to ${degrees(floor.high_deg)}`, kind: "band", colour: green }] : []),
        ...(next ? [{ name: "being made", kind: "dashed", colour: blue }] : []),
      ];
      const longest = (texts) => 7 * Math.max(...texts.map((text) => text.length));
      const isTight = longest(names.flatMap((name) => name.split(/\s+/))) > step; // a word has no room beside others
      const below = isTight ? Math.min(150, 24 + 0.6 * longest(names)) : longest(names) > step ? 62 : 32;
      this.chart.setOption({
        animationDuration: 300, textStyle: { color: shades.ink },
        grid: { left: 58, right: 16, top: 24, bottom: below },
        xAxis: {
          type: "category", data: names, axisTick: { show: false }, axisLine: { lineStyle: { color: shades.quiet } },
          axisLabel: { interval: 0, color: shades.ink, fontSize: step < 80 ? 11 : 12, lineHeight: 15,
            ...(isTight ? { rotate: 50, width: 170, overflow: "truncate" } : { width: Math.max(40, step - 2), overflow: "break" }),
          },
        },
        yAxis: axis(shades, { name: "error (RMSE), degrees", nameLocation: "middle", nameGap: 38, min: 0 }),
        series,
      }, true);
    },
  },
};
