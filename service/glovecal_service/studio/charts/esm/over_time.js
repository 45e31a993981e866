// The drawing of lines over linked time: angles above, errors below, one axis, takes as shaded stretches.
import { axis, tooltip } from "./index.js";

export const LEFT = 64, RIGHT = 18; // of both plots, px
export const LEAST_S = 0.2; // nothing shorter is shown
const LETTER = 7; // px, of a take's name
const TOP = { top: 50, height: 190 }, BELOW = { top: 276, height: 96 };

/** What can be shown alone: [{key, label, colour}]. `lines`: a model each, {label, takes}. */
export function seriesOf(lines, shades) {
  const of = (what, line) => (lines.length > 1 ? `${what}, ${line.label}` : what);
  return [
    { key: "measured", label: "Measured", colour: shades.ink },
    ...lines.map((line, i) => ({ key: `predicted ${i}`, label: `${of("Predicted", line)} ± 1 SD`, colour: shades.model(i) })),
    ...lines.map((line, i) => ({ key: `error ${i}`, label: of("Error", line), colour: shades.model(i) })),
  ];
}

/**
 * The option of ECharts. `lines` as above, their takes with `linked` seconds; `takes`: name, start_s, end_s, linked_s,
 * trained_on; `length`: linked seconds; `shown`: [from, to]; `alone`: the only series drawn, or null; `width`: px.
 */
export function overTime({ lines, takes, rotation, length, shown, alone }, shades, width, tip) {
  const shows = (key) => alone === null || alone === key;
  const drawn = [];
  const line = (key, grid, colour, value, more) => drawn.push({
    type: "line", name: key, xAxisIndex: grid, yAxisIndex: grid, showSymbol: false, silent: true,
    animation: false, z: 3, lineStyle: { color: colour, width: 1.6 }, itemStyle: { color: colour },
    data: shows(key) ? value : [], ...more,
  });
  lines.forEach((model, i) => {
    const colour = shades.model(i);
    if (shows(`predicted ${i}`)) drawn.push(band(model.takes, 0, colour, (take, k) => take.predicted_deg[k]));
    if (shows(`error ${i}`)) drawn.push(band(model.takes, 1, colour, () => 0));
    line(`predicted ${i}`, 0, colour, joined(model.takes, "predicted_deg"));
    line(`error ${i}`, 1, colour, joined(model.takes, "error_deg"));
  });
  line("measured", 0, shades.ink, joined(lines[0].takes, "measured_deg"), {
    z: 4, lineStyle: { color: shades.ink, width: 1.6, type: [5, 3] },
  });
  const named = { nameLocation: "middle", nameGap: 44 };
  const zoom = { xAxisIndex: [0, 1], filterMode: "none", startValue: shown[0], endValue: shown[1], minValueSpan: LEAST_S };
  return {
    animation: false,
    textStyle: { color: shades.ink },
    grid: [{ left: LEFT, right: RIGHT, ...TOP }, { left: LEFT, right: RIGHT, ...BELOW }],
    axisPointer: { link: [{ xAxisIndex: "all" }], lineStyle: { color: shades.quiet } },
    tooltip: tooltip(shades, { trigger: "axis", formatter: tip }),
    xAxis: [0, 1].map((grid) => axis(shades, {
      gridIndex: grid, min: 0, max: length, splitLine: { show: false },
      axisLabel: {
        show: grid === 1, color: shades.ink, showMinLabel: false, showMaxLabel: false, hideOverlap: true,
        formatter: "{value} s",
      },
    })),
    yAxis: [
      axis(shades, { gridIndex: 0, scale: true, name: `${rotation}, degrees`, ...named }),
      axis(shades, { gridIndex: 1, name: "error, degrees", splitNumber: 3, ...named }),
    ],
    dataZoom: [
      { type: "inside", ...zoom, zoomOnMouseWheel: "ctrl", preventDefaultMouseMove: false },
      {
        type: "slider", ...zoom, bottom: 6, height: 26, left: LEFT, right: RIGHT, brushSelect: false,
        showDetail: false, borderColor: shades.line, textStyle: { color: shades.ink },
      },
    ],
    series: [...drawn, ...[0, 1].map((grid) => bounds(takes, shades, grid, (take) => shortened(take, shown, width)))],
  };
}

/** Points of all takes, with a gap between two. */
function joined(takes, name) {
  return takes.flatMap((take) => [
    ...take.linked.map((time, i) => [time, take[name][i]]), [take.linked[take.linked.length - 1] ?? 0, null],
  ]);
}

/** One standard deviation on either side of `middle`, as one shape a take and run without a gap. */
function band(takes, grid, colour, middle) {
  const shapes = [];
  for (const take of takes) {
    let run = [];
    take.linked.forEach((time, k) => {
      const centre = middle(take, k), sd = take.sd_deg[k];
      if (centre === null || sd === null) {
        if (run.length > 1) shapes.push(run);
        run = [];
      } else run.push([time, centre, sd]);
    });
    if (run.length > 1) shapes.push(run);
  }
  return {
    type: "custom", xAxisIndex: grid, yAxisIndex: grid, silent: true, animation: false, clip: true, z: 1,
    tooltip: { show: false }, encode: { x: [0, 1], y: [2, 3] },
    data: shapes.map((run) => [
      run[0][0], run[run.length - 1][0],
      Math.min(...run.map(([, centre, sd]) => centre - sd)), Math.max(...run.map(([, centre, sd]) => centre + sd)),
    ]),
    renderItem: (params, api) => {
      const run = shapes[params.dataIndex];
      const up = run.map(([time, centre, sd]) => api.coord([time, centre + sd]));
      const down = run.map(([time, centre, sd]) => api.coord([time, centre - sd])).reverse();
      return { type: "polygon", shape: { points: [...up, ...down] }, style: { fill: colour, opacity: 0.2 } };
    },
  };
}

/** As much of its name as there is room for over the part of the take that is shown. */
function shortened(take, [from, to], width) {
  const seconds = Math.min(to, take.linked_s + take.end_s - take.start_s) - Math.max(from, take.linked_s);
  const room = (seconds / (to - from)) * (width - LEFT - RIGHT);
  const names = [take.name + (take.trained_on ? " (trained on)" : ""), take.name];
  return names.find((name) => LETTER * (name.length + 1) <= room) ?? "";
}

/** Where takes begin and end, with their names; below, the line of no error. */
function bounds(takes, shades, grid, nameOf) {
  return {
    type: "line", xAxisIndex: grid, yAxisIndex: grid, data: [], silent: true,
    markArea: {
      silent: true,
      label: { show: grid === 0, color: shades.ink, position: "insideTop", fontSize: 12 },
      data: takes.map((take, i) => [
        {
          name: nameOf(take), xAxis: take.linked_s,
          itemStyle: { color: shades.quiet, opacity: i % 2 ? 0.12 : 0.05 },
        },
        { xAxis: take.linked_s + take.end_s - take.start_s },
      ]),
    },
    markLine: grid ? {
      silent: true, symbol: "none", label: { show: false }, data: [{ yAxis: 0 }],
      lineStyle: { color: shades.quiet, type: "solid" },
    } : undefined,
  };
}
