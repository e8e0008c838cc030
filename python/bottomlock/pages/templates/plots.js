/* Plots that share one time, and a map beside them, from the data within the page. Nothing is loaded. */
(async () => {
  "use strict";
  const holder = document.getElementById("plots-data");
  // Without these the figures stand, as they do without scripts.
  if (!holder || !window.DecompressionStream || !window.uPlot || !window.ResizeObserver) return;
  const page = JSON.parse(holder.textContent);
  const read = await unpacked(page);
  const root = document.getElementById("plots");

  /* --- data ------------------------------------------------------------------------------------------------ */

  async function unpacked({ data, arrays }) {
    const bytes = Uint8Array.from(atob(data), one => one.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const whole = new DataView(await new Response(stream).arrayBuffer());
    const MISSING = -(2 ** 31);
    const kept = new Map();
    return index => {
      if (index === null || index === undefined) return null;
      if (!kept.has(index)) {
        const [start, length, step] = arrays[index];
        const values = new Array(length);
        let sum = 0;
        for (let k = 0; k < length; k++) {
          const one = whole.getInt32(4 * (start + k), true);
          values[k] = one === MISSING ? null : (sum += one) * step;
        }
        kept.set(index, values);
      }
      return kept.get(index);
    };
  }

  const loaded = new Map();
  function view(key) {
    if (!loaded.has(key)) {
      const { panels, tracks, frame } = page.views[key];
      const curve = one => ({ ...one, t: read(one.t), v: read(one.v), sd: read(one.sd) });
      const track = one => ({ ...one, t: read(one.t), n: read(one.n), e: read(one.e), sn: read(one.sn), se: read(one.se), lost: read(one.lost) });
      loaded.set(key, { frame, panels: panels.map(one => ({ ...one, curves: one.curves.map(curve) })), tracks: tracks.map(track) });
    }
    return loaded.get(key);
  }

  /** The last index whose time is at most t, -1 for none. */
  function before(times, t) {
    let low = -1, high = times.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle; else high = middle;
    }
    return low;
  }

  function nearest(times, t) {
    const k = before(times, t);
    if (k < 0) return 0;
    return k + 1 < times.length && times[k + 1] - t < t - times[k] ? k + 1 : k;
  }

  const minus = text => text.replace("-", "−");
  const two = number => String(number).padStart(2, "0");
  function clock(t, digits) {
    if (!page.utc) return `${minus(t.toFixed(digits))} s`;
    // To the digit that is shown, so that 59.999 s is the next minute.
    const part = 10 ** digits, rounded = Math.round((page.start_s + t) * part) / part;
    const at = new Date(Math.floor(rounded) * 1000), rest = rounded - Math.floor(rounded);
    const fraction = digits ? rest.toFixed(digits).slice(1) : "";
    return `${two(at.getUTCHours())}:${two(at.getUTCMinutes())}:${two(at.getUTCSeconds())}${fraction}`;
  }
  const day = t => new Date((page.start_s + t) * 1000).toISOString().slice(0, 10);

  function value(curve, panel, t) {
    const { t: times, v, sd, kind } = curve;
    if (!times.length || t < times[0] || t > times[times.length - 1]) return "–";
    const k = kind === "held" ? before(times, t) : nearest(times, t);
    if (panel.names.length) return v[k] === null ? "lost" : "valid";
    if (v[k] === null) return "–";
    const claimed = sd && sd[k] !== null ? ` ± ${sd[k].toFixed(panel.decimals)}` : "";
    return minus(wrapped(v[k], panel).toFixed(panel.decimals)) + claimed;
  }

  /** A heading of more than a turn, within one. */
  const wrapped = (one, panel) => (panel.period ? ((one % panel.period) + panel.period) % panel.period : one);

  /* --- what all parts share: the view, the range of time, the time under the cursor --------------------------- */

  const state = { key: "", view: null, all: [0, 1], range: [0, 1], at: null };
  let plots = [];
  let map = null;

  function element(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    for (const [key, one] of Object.entries(attributes)) made.setAttribute(key, one);
    made.append(...children);
    return made;
  }
  function drawn(name, attributes = {}, ...children) {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, one] of Object.entries(attributes)) made.setAttribute(key, one);
    made.append(...children);
    return made;
  }
  const ink = name => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

  let busy = false;
  function together(change) {
    if (busy) return;
    busy = true;
    try { change(); } finally { busy = false; }
  }

  function setRange(low, high) {
    const least = Math.max((state.all[1] - state.all[0]) / 1e5, 0.05);
    const width = Math.min(Math.max(high - low, least), state.all[1] - state.all[0]);
    const start = Math.min(Math.max(low, state.all[0]), state.all[1] - width);
    state.range = [start, start + width];
    together(() => plots.forEach(one => one.plot.setScale("x", { min: state.range[0], max: state.range[1] })));
    map.draw();
    showAt(state.at);
  }

  function zoom(factor, about) {
    const [low, high] = state.range;
    const fixed = about ?? (state.at !== null && state.at >= low && state.at <= high ? state.at : (low + high) / 2);
    setRange(fixed - (fixed - low) * factor, fixed + (high - fixed) * factor);
  }

  function showAt(t, source = null) {
    state.at = t;
    const digits = state.range[1] - state.range[0] < 60 ? 2 : 1;
    together(() => {
      for (const { plot, panel, values } of plots) {
        if (plot !== source) {
          const left = t === null ? -10 : plot.valToPos(t, "x");
          const there = left >= 0 && left <= plot.over.clientWidth;
          plot.setCursor({ left: there ? left : -10, top: there ? 0 : -10 }, false);
        }
        panel.curves.forEach((curve, k) => { values[k].textContent = t === null ? "" : value(curve, panel, t); });
      }
    });
    map.mark(t);
    const from = page.utc ? `${day(state.range[0])} ${clock(state.range[0], 0)}` : clock(state.range[0], 0);
    bar.range.textContent = `${from} to ${clock(state.range[1], 0)}${page.utc ? " UTC" : " from the start"}`;
    bar.time.textContent = t === null ? "" : page.utc ? `${clock(t, digits)} UTC (${t.toFixed(digits)} s)` : clock(t, digits);
    bar.place.textContent = t === null ? "" : map.words(t);
  }

  function keys(event) {
    if (event.altKey || event.metaKey || event.ctrlKey) return;
    const [low, high] = state.range;
    const step = (high - low) / (event.shiftKey ? 20 : 200);
    const at = state.at === null ? (low + high) / 2 : state.at;
    const moves = { ArrowLeft: at - step, ArrowRight: at + step, Home: low, End: high };
    if (event.key in moves) {
      const to = Math.min(Math.max(moves[event.key], state.all[0]), state.all[1]);
      if (to < low || to > high) setRange(low + to - at, high + to - at);
      showAt(to);
    } else if (event.key === "+" || event.key === "=") zoom(0.5);
    else if (event.key === "-") zoom(2);
    else if (event.key === "0") { setRange(...state.all); map.fit(); }
    else if (event.key === "Escape") showAt(null);
    else return;
    event.preventDefault();
  }

  /* --- bar ------------------------------------------------------------------------------------------------------ */

  const bar = { time: element("output", { class: "at", "aria-live": "off" }), place: element("span", { class: "quiet place" }), range: element("span", { class: "quiet range" }) };
  function button(words, title, act) {
    const made = element("button", { type: "button", title }, words);
    made.addEventListener("click", act);
    return made;
  }
  const choices = page.choices.map(({ name, options, first }) => {
    const select = element("select", {}, ...options.map(one => element("option", { value: one }, one)));
    select.value = first;
    select.addEventListener("change", show);
    return element("label", options.length < 2 ? { hidden: "" } : {}, `${name} `, select);
  });
  const chosen = () => choices.map(one => one.querySelector("select").value).join("\n");

  /* --- plots ------------------------------------------------------------------------------------------------------ */

  function rgba(colour, alpha) {
    const [r, g, b] = [1, 3, 5].map(k => parseInt(colour.slice(k, k + 2), 16));
    return `rgba(${r},${g},${b},${alpha})`;
  }

  /** What is held, as lines from where each begins to where it ends. */
  function held({ t, v }) {
    const times = [], values = [];
    const add = (at, one) => { times.push(at); values.push(one); };
    t.forEach((at, k) => {
      if (k && v[k - 1] !== null) { add(at - 2e-4, v[k - 1]); add(at - 1e-4, null); }
      if (v[k] !== null) add(at, v[k]);
    });
    return [times, values];
  }

  function tables(panel) {
    return panel.curves.map(curve => {
      if (curve.kind === "held") return held(curve);
      const positive = panel.log ? curve.v.map(one => (one > 0 ? one : null)) : curve.v;
      if (!curve.sd) return [curve.t, positive];
      const side = sign => positive.map((one, k) => (one === null || curve.sd[k] === null ? null : one + sign * curve.sd[k]));
      return [curve.t, positive, side(1), side(-1)];
    });
  }

  /** With one time for all; a gap goes on to the next value of its own curve (2: nulls are expanded). */
  const joined = parts => uPlot.join(parts, parts.map(one => one.map(() => 2)));

  /** Powers of ten within a range; of a short one their double and fivefold too. */
  function decades(low, high) {
    const found = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) {
      for (const one of high / low > 30 ? [1] : [1, 2, 5]) found.push(one * 10 ** power);
    }
    return found.filter(one => one >= low && one <= high);
  }

  function makePlot(panel, width) {
    const series = [{}], bands = [];
    for (const curve of panel.curves) {
      const look = { stroke: curve.colour, width: curve.width, dash: curve.dash.length ? curve.dash : undefined, points: { show: false } };
      if (curve.kind === "dots") Object.assign(look, { paths: () => null, points: { show: true, size: 3, fill: curve.colour, stroke: curve.colour } });
      if (curve.kind === "held") look.cap = "butt";
      series.push(look);
      if (curve.sd) {
        const edge = { stroke: "transparent", width: 0, points: { show: false } };
        series.push({ ...edge }, { ...edge });
        bands.push({ series: [series.length - 2, series.length - 1], fill: rgba(curve.colour, 0.2) });
      }
    }
    const names = panel.names.length;
    const axis = { stroke: () => ink("quiet"), grid: { stroke: () => ink("line"), width: 1 }, ticks: { stroke: () => ink("line"), width: 1, size: 4 }, font: "12px system-ui, sans-serif" };
    const time = {
      ...axis, size: 26, space: 74,
      values: (plot, splits, index, space, step) => splits.map(t => (page.utc ? clock(t, step < 1 ? 1 : 0).replace(/^(\d\d:\d\d):00$/, "$1") : minus(String(+t.toFixed(2))))),
      splits: (plot, index, low, high, step) => {
        const offset = page.utc ? page.start_s % 86400 : 0;
        const found = [];
        for (let k = Math.ceil((low + offset) / step); k * step - offset <= high; k++) found.push(k * step - offset);
        return found;
      },
      incrs: [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400],
    };
    const levels = {
      ...axis, size: 58, space: names ? 12 : 22,
      splits: names ? () => panel.names.map((_, k) => k + 1) : panel.log ? (plot, index, low, high) => decades(low, high) : undefined,
      values: names ? () => panel.names : panel.log ? (plot, splits) => splits.map(one => String(+one.toPrecision(3))) : (plot, splits) => splits.map(one => minus(String(+wrapped(one, panel).toPrecision(10)))),
    };
    if (panel.period) levels.incrs = [1, 2, 5, 10, 15, 30, 45, 90, 180, 360, 720, 1440, 3600, 7200, 36000].map(one => one * panel.period / 360);
    if (names) levels.grid = { show: false };
    const y = names ? { range: [names + 0.6, 0.4] } : panel.log ? { distr: 3, range: (plot, low, high) => [Math.max(low, high * 1e-6, 1e-6) / 1.3, high * 1.3] } : {};
    if (names) y.range = () => [names + 0.6, 0.4];
    if (panel.down) y.dir = -1;
    const shade = plot => {
      if (!panel.band) return;
      const [low, high] = panel.band.map(one => plot.valToPos(one, "y", true));
      const { left, top, width, height } = plot.bbox, context = plot.ctx;
      const from = Math.max(Math.min(low, high), top), to = Math.min(Math.max(low, high), top + height);
      if (to <= from) return;
      context.save();
      context.fillStyle = rgba("#8b949e", 0.3);
      context.fillRect(left, from, width, to - from);
      context.restore();
    };
    return {
      width, height: names ? 34 + 16 * names : 118, series, bands,
      scales: { x: { time: false, range: (plot, low, high) => [low, high] }, y },
      axes: [time, levels],
      legend: { show: false },
      cursor: { y: false, points: { show: false }, drag: { x: true, y: false, setScale: false, dist: 4 } },
      padding: [6, 22, 0, 0],
      hooks: {
        drawClear: [shade],
        setCursor: [plot => { if (!busy && plot.cursor.left >= 0) showAt(plot.posToVal(plot.cursor.left, "x"), plot); }],
        setSelect: [plot => {
          const { left, width: wide } = plot.select;
          if (wide > 0) {
            setRange(plot.posToVal(left, "x"), plot.posToVal(left + wide, "x"));
            plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          }
        }],
      },
    };
  }

  function makePanel(panel) {
    const values = panel.curves.map(() => element("b", {}));
    const names = panel.curves.map((curve, k) => {
      const swatch = element("i", { class: `swatch-${curve.kind}${curve.dash.length ? " dashed" : ""}` });
      swatch.style.color = curve.colour;
      return element("span", {}, swatch, ` ${curve.label} `, values[k]);
    });
    const holder = element("div", { class: "canvas", tabindex: "0", role: "img", "aria-label": `${panel.title}: ${panel.curves.map(one => one.label).join(", ")}` });
    const made = element("div", { class: "panel" }, element("p", {}, element("strong", {}, panel.title), ...names), holder);
    holder.addEventListener("keydown", keys);
    column.append(made);
    const plot = new uPlot(makePlot(panel, Math.max(holder.clientWidth, 120)), joined(tables(panel)), holder);
    plot.over.addEventListener("dblclick", () => setRange(...state.all));
    plot.over.addEventListener("wheel", event => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      zoom(event.deltaY > 0 ? 1.25 : 0.8, plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x"));
    }, { passive: false });
    return { panel, plot, values, holder };
  }

  /* --- map -------------------------------------------------------------------------------------------------------- */

  const LOST = ["#f0c24b", "#f0862d", "#d6391f", "#9c2a6e"];

  function makeMap() {
    const height = 420, inset = { left: 58, right: 10, top: 10, bottom: 40 };
    const svg = drawn("svg", { class: "map", tabindex: "0", role: "img", "aria-label": "Way over ground" });
    const legend = element("p", { class: "legend" });
    const box = element("div", { class: "panel" }, element("p", {}, element("strong", {}, "Way over ground, m from the origin")), svg, legend);
    const marker = drawn("g", { class: "marker" });
    let width = 400, middle = [0, 0], scale = 1;
    const x = east => inset.left + (width - inset.left - inset.right) / 2 + (east - middle[1]) * scale;
    const y = north => inset.top + (height - inset.top - inset.bottom) / 2 - (north - middle[0]) * scale;

    function fit() {
      const [south, north, west, east] = state.view.frame;
      middle = [(south + north) / 2, (west + east) / 2];
      scale = Math.min((width - inset.left - inset.right) / (east - west), (height - inset.top - inset.bottom) / (north - south));
      draw();
    }

    function path(track, from, to) {
      let text = "", pen = "M";
      for (let k = from; k < to; k++) {
        if (track.n[k] === null) { pen = "M"; continue; }
        text += `${pen}${x(track.e[k]).toFixed(1)} ${y(track.n[k]).toFixed(1)}`;
        pen = "L";
      }
      return text;
    }

    function nice(most) {
      const power = 10 ** Math.floor(Math.log10(most));
      return [5, 2, 1].map(one => one * power).find(one => one <= most * (1 + 1e-9));
    }

    function ellipse(track, k, kind) {
      return drawn("ellipse", { class: kind, cx: x(track.e[k]), cy: y(track.n[k]), rx: 2 * track.se[k] * scale, ry: 2 * track.sn[k] * scale, stroke: track.colour });
    }

    function ways(clip) {
      const [low, high] = state.range;
      const seen = new Set();
      const first = state.view.tracks[0];
      for (const track of [...state.view.tracks].reverse()) {
        const from = Math.max(before(track.t, low), 0), to = before(track.t, high) + 1;
        const line = { stroke: track.colour, "stroke-width": track.width, "stroke-dasharray": track.dash.join(" ") };
        const broad = track.sn === null;
        if (track === first && track.lost) {
          for (let k = from + 1; k < to;) {
            const lost = Math.round(track.lost[k]);
            let end = k;
            while (end < to && Math.round(track.lost[end]) === lost) end++;
            if (lost > 0) {
              const index = Math.min(lost, LOST.length) - 1;
              seen.add(lost);
              clip.append(drawn("path", { class: "lost", d: path(track, k - 1, end), stroke: LOST[index], "stroke-width": 6 + index }));
            }
            k = end;
          }
        }
        if (from > 0 || to < track.t.length) clip.append(drawn("path", { ...line, class: "outside", d: path(track, 0, track.t.length) }));
        clip.append(drawn("path", { ...line, class: broad ? "broad" : "way", d: path(track, from, to) }));
        if (!broad && to > from) {
          const spots = new Set([1, 2, 3, 4, 5, 6, 7, 8].map(part => nearest(track.t, Math.max(low, track.t[0]) + (Math.min(high, track.t[track.t.length - 1]) - Math.max(low, track.t[0])) * part / 8)));
          for (const k of spots) if (track.se[k] > 0 && 4 * Math.max(track.se[k], track.sn[k]) * scale < width / 2) clip.append(ellipse(track, k, "claim"));
        }
      }
      return seen;
    }

    function draw() {
      if (!state.view) return;
      svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      svg.setAttribute("height", height);
      svg.replaceChildren();
      const right = width - inset.right, bottom = height - inset.bottom;
      svg.append(drawn("clipPath", { id: "map-clip" }, drawn("rect", { x: inset.left, y: inset.top, width: right - inset.left, height: bottom - inset.top })));
      const step = nice(90 / scale) ?? 1, digits = step < 1 ? Math.ceil(-Math.log10(step)) : 0;
      const label = one => minus(Number(one.toFixed(digits) === "-0" ? 0 : one).toFixed(digits));
      const east0 = middle[1] - (right - inset.left) / 2 / scale, north0 = middle[0] - (bottom - inset.top) / 2 / scale;
      for (let k = Math.ceil(east0 / step); x(k * step) <= right; k++) {
        const at = x(k * step);
        svg.append(drawn("path", { class: "grid", d: `M${at} ${inset.top}V${bottom}` }), drawn("text", { x: at, y: bottom + 16, "text-anchor": "middle" }, label(k * step)));
      }
      for (let k = Math.ceil(north0 / step); y(k * step) >= inset.top; k++) {
        const at = y(k * step);
        svg.append(drawn("path", { class: "grid", d: `M${inset.left} ${at}H${right}` }), drawn("text", { x: inset.left - 6, y: at + 4, "text-anchor": "end" }, label(k * step)));
      }
      svg.append(drawn("text", { x: (inset.left + right) / 2, y: height - 6, "text-anchor": "middle" }, "east, m"),
        drawn("text", { transform: `translate(13 ${(inset.top + bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, "north, m"));
      const clip = drawn("g", { "clip-path": "url(#map-clip)" });
      svg.append(clip);
      const seen = ways(clip);
      const start = state.view.tracks[0];
      if (start.t.length) clip.append(drawn("circle", { class: "start", cx: x(start.e[0]), cy: y(start.n[0]), r: 4 }), drawn("text", { x: x(start.e[0]) + 7, y: y(start.n[0]) - 6 }, "start"));
      const length = nice((right - inset.left) / 4 / scale);
      const bar0 = inset.left + 10, words = length >= 1000 ? `${length / 1000} km` : `${length} m`;
      svg.append(drawn("path", { class: "scale", d: `M${bar0} ${bottom - 10}h${length * scale}` }), drawn("text", { class: "scale-words", x: bar0, y: bottom - 16 }, words),
        drawn("path", { class: "north", d: `M${right - 14} ${inset.top + 34}v-20m-4 7l4-9l4 9z` }), drawn("text", { x: right - 14, y: inset.top + 47, "text-anchor": "middle" }, "N"));
      clip.append(marker);
      named(seen);
      mark(state.at);
    }

    function named(seen) {
      const item = (kind, colour, words) => {
        const swatch = element("i", { class: kind });
        swatch.style.color = colour;
        return element("span", {}, swatch, ` ${words}`);
      };
      legend.replaceChildren(
        ...state.view.tracks.map(one => item(one.sn === null ? "swatch-held" : `swatch-line${one.dash.length ? " dashed" : ""}`, one.colour, one.label.replaceAll("_", " "))),
        ...[...seen].sort().map(one => item("swatch-held", LOST[Math.min(one, LOST.length) - 1], `${one} ${one === 1 ? "beam" : "beams"} lost`)),
        element("span", {}, "ellipses: 2σ of north and east"));
    }

    function mark(t) {
      marker.replaceChildren();
      if (t === null || !state.view) return;
      for (const track of [...state.view.tracks].reverse()) {
        if (!track.t.length || t < track.t[0] || t > track.t[track.t.length - 1]) continue;
        const k = nearest(track.t, t);
        if (track.n[k] === null) continue;
        if (track.sn && track.se[k] > 0) marker.append(ellipse(track, k, "claim now"));
        marker.append(drawn("circle", { cx: x(track.e[k]), cy: y(track.n[k]), r: track.sn ? 5 : 3.5, fill: track.colour, "data-label": track.label }));
      }
    }

    function words(t) {
      const track = state.view.tracks[0];
      if (!track.t.length) return "";
      const k = nearest(track.t, t);
      if (track.n[k] === null) return "";
      const metres = `north ${minus(track.n[k].toFixed(1))} m, east ${minus(track.e[k].toFixed(1))} m`;
      if (!page.place) return metres;
      const [latitude, longitude, perLatitude, perLongitude] = page.place;
      const lat = latitude + track.n[k] / perLatitude, lon = longitude + track.e[k] / perLongitude;
      return `${metres}; ${Math.abs(lat).toFixed(6)}° ${lat < 0 ? "S" : "N"}, ${Math.abs(lon).toFixed(6)}° ${lon < 0 ? "W" : "E"}`;
    }

    function zoomMap(factor, px = width / 2, py = height / 2) {
      const east = middle[1] + (px - x(middle[1])) / scale, north = middle[0] - (py - y(middle[0])) / scale;
      scale *= factor;
      middle = [north - (north - middle[0]) / factor, east - (east - middle[1]) / factor];
      draw();
    }

    let held = null;
    svg.addEventListener("pointerdown", event => { held = [event.clientX, event.clientY, ...middle]; });
    window.addEventListener("pointerup", () => { held = null; });
    svg.addEventListener("pointermove", event => {
      if (held && event.pointerType === "mouse") {
        middle = [held[2] + (event.clientY - held[1]) / scale, held[3] - (event.clientX - held[0]) / scale];
        return draw();
      }
      hover(event);
    });
    svg.addEventListener("click", hover);
    function hover(event) {
      const area = svg.getBoundingClientRect(), track = state.view.tracks[0];
      const px = (event.clientX - area.left) * width / area.width, py = (event.clientY - area.top) * height / area.height;
      let best = -1, least = 40 ** 2;
      const [low, high] = state.range;
      for (let k = 0; k < track.t.length; k++) {
        if (track.n[k] === null || track.t[k] < low || track.t[k] > high) continue;
        const distance = (x(track.e[k]) - px) ** 2 + (y(track.n[k]) - py) ** 2;
        if (distance < least) { least = distance; best = k; }
      }
      if (best >= 0) showAt(track.t[best]);
    }
    svg.addEventListener("wheel", event => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      const area = svg.getBoundingClientRect();
      zoomMap(event.deltaY > 0 ? 0.8 : 1.25, event.clientX - area.left, event.clientY - area.top);
    }, { passive: false });
    svg.addEventListener("dblclick", fit);
    svg.addEventListener("keydown", event => {
      if (event.key === "+" || event.key === "=" || event.key === "-") {
        zoomMap(event.key === "-" ? 0.5 : 2, ...centre());
        event.preventDefault();
      } else keys(event);
    });
    function centre() {
      const track = state.view.tracks[0];
      if (state.at === null || !track.t.length) return [undefined, undefined];
      const k = nearest(track.t, state.at);
      return track.n[k] === null ? [undefined, undefined] : [x(track.e[k]), y(track.n[k])];
    }
    box.insertBefore(element("p", { class: "tools" },
      button("Map +", "Zoom into the map", () => zoomMap(2, ...centre())),
      button("Map −", "Zoom out of the map", () => zoomMap(0.5, ...centre())),
      button("Whole map", "The whole track", () => fit())), legend);
    function resize() {
      const wide = svg.clientWidth || 400;
      if (wide === width) return;
      scale *= (wide - inset.left - inset.right) / (width - inset.left - inset.right);
      width = wide;
      draw();
    }
    return { box, draw, fit, mark, words, resize };
  }

  /* --- together ------------------------------------------------------------------------------------------------------- */

  const column = element("div", { class: "column" });
  const mapped = Object.values(page.views).some(one => one.tracks.length);
  map = mapped ? makeMap() : { draw() {}, fit() {}, mark() {}, words: () => "", resize() {} };
  root.append(
    element("div", { class: "bar" }, ...choices,
      element("span", { class: "tools" }, button("Time +", "Zoom into the time", () => zoom(0.5)), button("Time −", "Zoom out", () => zoom(2)), button("Whole time", "All there is", () => setRange(...state.all)))),
    element("div", { class: "now" }, bar.time, bar.place, bar.range),
    element("div", { class: "both" }, ...(mapped ? [element("div", { class: "beside" }, map.box)] : []), column));

  function extent() {
    const ends = state.view.panels.flatMap(panel => panel.curves.filter(one => one.t.length).flatMap(one => [one.t[0], one.t[one.t.length - 1]]));
    const low = Math.min(...ends), high = Math.max(...ends);
    return [low, high > low ? high : low + 1];
  }

  function show() {
    const first = state.view === null, whole = first || (state.range[0] === state.all[0] && state.range[1] === state.all[1]);
    const frame = first ? "" : String(state.view.frame);
    state.key = chosen();
    state.view = view(state.key);
    state.all = extent();
    if (whole) state.range = [...state.all];
    plots.forEach(one => one.plot.destroy());
    column.replaceChildren();
    plots = state.view.panels.map(makePanel);
    if (String(state.view.frame) !== frame) map.fit(); else map.draw();
    setRange(...state.range);
  }

  document.documentElement.classList.add("scripted");
  map.resize();
  show();
  let known = 0;
  new ResizeObserver(() => {
    if (root.clientWidth === known || !root.clientWidth) return;
    known = root.clientWidth;
    together(() => plots.forEach(({ plot, holder: around }) => plot.setSize({ width: Math.max(around.clientWidth, 120), height: plot.height })));
    map.resize();
    showAt(state.at);
  }).observe(root);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plots.forEach(({ plot }) => plot.redraw(false)));
  root.dataset.ready = "yes";
})();
