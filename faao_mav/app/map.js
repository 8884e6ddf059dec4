// The map of the planner page: what is dragged and drawn here is told to the server, which answers
// with the flight. Coordinates are [latitude, longitude] in degrees, radii metres.
import { leaflet as L } from "nicegui-leaflet";
import { loadResource } from "../../static/utils/resources.js";

const SHADES = 20; // colours of the route
const PERIOD = 50; // milliseconds between two reports of one drag
const LINES = {
  "zone-in": "stay in",
  "zone-out": "stay out",
  margin: "margin of the fence",
  track: "predicted flight",
  flown: "flown",
  moving: "stations move",
};
const SIDES = [[1, -1], [1, 1], [1, 0], [-1, -1], [-1, 1], [-1, 0], [0, -1], [0, 1]]; // of a waypoint, for its number
const NUDGE = 10, FINE = 1; // pixels by which an arrow key moves a marker, and with Shift

// The colour at a share of the way along `shades`, #rrggbb each.
function colour(shades, share) {
  const x = Math.min(0.999, Math.max(0, share)) * (shades.length - 1), k = Math.floor(x);
  const [from, to] = [shades[k], shades[k + 1]].map((each) => each.match(/\w\w/g).map((hex) => parseInt(hex, 16)));
  return `rgb(${from.map((c, i) => Math.round(c + (x - k) * (to[i] - c))).join(",")})`;
}

const zone_class = (inclusion) => (inclusion ? "zone-in" : "zone-out");
const pair = (p) => [p.lat, p.lng];

function icon(kind, label = "") {
  const text = document.createElement("span");
  text.textContent = label;
  return L.divIcon({ className: `mark mark-${kind}`, html: text, iconSize: [18, 18] });
}

export default {
  template: '<div class="planner-map"><div role="application" aria-label="Map"></div><div class="key"></div></div>',
  props: { resourcePath: String },
  async mounted() {
    await this.$nextTick();
    await loadResource(`${window.path_prefix}${this.resourcePath}/leaflet/leaflet.css`);
    this.map = L.map(this.$el.firstElementChild, { zoomSnap: 0.25, doubleClickZoom: false, center: [0, 0], zoom: 2 });
    this.map.attributionControl.setPrefix(false);
    this.map.on("mousemove", ({ latlng }) => this.map.attributionControl.setPrefix(`${latlng.lat.toFixed(6)}, ${latlng.lng.toFixed(6)}`));
    L.control.scale({ imperial: false }).addTo(this.map);
    const group = () => L.layerGroup().addTo(this.map);
    Object.assign(this, { zones: group(), route: group(), dots: group(), marks: group(), handles: group() });
    Object.assign(this, { lines: [], waypoints: [] });
    this.aircraft = L.marker([0, 0], { icon: icon("aircraft", "✈"), interactive: false, zIndexOffset: 900 });
    this.vehicle = L.marker([0, 0], { icon: icon("vehicle", "Vehicle"), interactive: false, zIndexOffset: 950 });
    this.track = L.polyline([], { className: "flown", interactive: false });
    this.map.on("click", (e) => (this.drawing ? this.corner(e.latlng) : this.select(null)));
    this.map.on("dblclick", () => this.finish());
    this.map.on("zoomend", () => this.show_waypoints());
    this.$el.addEventListener("keydown", (e) => {
      if (e.key === "Escape") this.draw(null);
      if (e.key === "Enter" && this.drawing) this.finish();
      if (e.key === "Delete") this.remove_selected();
    });
    this.watching = new ResizeObserver(() => this.map.invalidateSize());
    this.watching.observe(this.$el);
    this.$emit("ready");
  },
  unmounted() {
    this.watching?.disconnect();
    this.map?.remove();
  },
  methods: {
    // Report at most every PERIOD, and the last of several always.
    tell(event, what) {
      const last = (this.told ??= {})[event] ?? { at: -PERIOD };
      clearTimeout(last.waiting);
      const wait = what.done ? 0 : PERIOD - (performance.now() - last.at);
      const waiting = wait > 0 ? setTimeout(() => this.tell(event, what), wait) : null;
      this.told[event] = { at: waiting ? last.at : performance.now(), waiting };
      if (!waiting) this.$emit(event, what);
    },
    draggable(at, kind, label, title, moved) {
      const marker = L.marker(at, { icon: icon(kind, label), draggable: true, title, alt: title, keyboard: true });
      marker.on("dragstart", () => (this.dragging = true));
      marker.on("drag", () => moved(marker.getLatLng(), false));
      marker.on("dragend", () => {
        this.dragging = false;
        moved(marker.getLatLng(), true);
      });
      marker.on("keydown", (e) => {
        const way = { ArrowUp: [0, -1], ArrowDown: [0, 1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] }[e.originalEvent.key];
        if (!way) return;
        L.DomEvent.stop(e.originalEvent);
        const size = e.originalEvent.shiftKey ? FINE : NUDGE;
        const place = this.map.latLngToContainerPoint(marker.getLatLng()).add(L.point(way).multiplyBy(size));
        marker.setLatLng(this.map.containerPointToLatLng(place));
        moved(marker.getLatLng(), true);
      });
      return marker;
    },
    // What the plan says: stations, ends and zones. During a drag the page knows better.
    scene(stations, zones, fit) {
      if (this.dragging) return;
      const focused = document.activeElement?.title;
      this.marks.clearLayers();
      for (const { key, label, at } of stations) {
        const moved = (to, done) => this.tell("moved", { key, at: pair(to), done });
        this.draggable(at, key, label, label, moved).addTo(this.marks);
      }
      if (focused) this.$el.querySelector(`[title="${CSS.escape(focused)}"]`)?.focus();
      this.shapes = zones;
      this.show_zones();
      this.show_key();
      if (fit && stations.length) this.map.fitBounds(L.latLngBounds([...stations.map((s) => s.at), ...(this.ways ?? [])]).pad(0.35));
    },
    show_zones() {
      this.zones.clearLayers();
      for (const zone of this.shapes) {
        const style = { className: zone_class(zone.inclusion), bubblingMouseEvents: false, fill: !zone.inclusion };
        const shape = zone.center ? L.circle(zone.center, { ...style, radius: zone.radius }) : L.polygon(zone.corners, style);
        shape.on("click", (e) => (this.drawing ? this.corner(e.latlng) : this.select(zone.key))).addTo(this.zones);
        zone.shape = shape;
      }
      this.select(this.shapes.some((zone) => zone.key === this.selected) ? this.selected : null);
    },
    select(key) {
      this.selected = key;
      this.handles.clearLayers();
      const zone = this.shapes?.find((each) => each.key === key);
      if (!zone) return;
      const change = (done) => {
        const { inclusion, center, radius, corners } = zone;
        this.tell("zone", { key, inclusion, center, radius, corners, done });
      };
      const middle = zone.center ?? pair(zone.shape.getBounds().getCenter());
      let last = middle;
      this.draggable(middle, "move", "✥", "Move the zone", (to, done) => {
        const by = [to.lat - last[0], to.lng - last[1]];
        last = pair(to);
        if (zone.center) zone.shape.setLatLng((zone.center = pair(to)));
        else zone.shape.setLatLngs((zone.corners = zone.corners.map((c) => [c[0] + by[0], c[1] + by[1]])));
        change(done);
      }).addTo(this.handles);
      if (zone.center) {
        const edge = [middle[0], zone.shape.getBounds().getEast()];
        this.draggable(edge, "corner", "", "Radius", (to, done) => {
          zone.shape.setRadius((zone.radius = this.map.distance(zone.center, to)));
          change(done);
        }).addTo(this.handles);
      }
      zone.corners?.forEach((corner, k) =>
        this.draggable(corner, "corner", "", `Corner ${k + 1}`, (to, done) => {
          zone.corners[k] = pair(to);
          zone.shape.setLatLngs(zone.corners);
          change(done);
        }).addTo(this.handles),
      );
    },
    // Keys count zones: with this one gone, its key is that of the next, which nobody has chosen.
    remove_selected() {
      const key = this.selected;
      this.select(null);
      if (key) this.$emit("removed", { key });
    },
    // Begin to draw a "polygon" or a "circle" to stay in or out of; null ends without one.
    draw(kind, inclusion) {
      this.drawing = kind ? { kind, inclusion, points: [] } : null;
      this.handles.clearLayers();
      this.$el.classList.toggle("drawing", !!kind);
    },
    corner(at) {
      const { kind, points } = this.drawing;
      const last = points.at(-1);
      if (last && this.map.latLngToContainerPoint(last).distanceTo(this.map.latLngToContainerPoint(at)) < 4) return;
      points.push(at);
      L.circleMarker(at, { radius: 4, interactive: false }).addTo(this.handles);
      if (points.length > 1) L.polyline(points.slice(-2), { interactive: false, dashArray: "4" }).addTo(this.handles);
      if (kind === "circle" && points.length === 2) this.finish();
    },
    finish() {
      if (!this.drawing) return;
      const { kind, inclusion, points } = this.drawing;
      this.draw(null);
      if (kind === "circle" && points.length === 2) {
        this.$emit("zone", { key: null, inclusion, center: pair(points[0]), radius: this.map.distance(...points), done: true });
      } else if (kind === "polygon" && points.length > 2) {
        this.$emit("zone", { key: null, inclusion, corners: points.map(pair), done: true });
      }
    },
    // The flight: planned route coloured by speed, predicted track, waypoints, the fence's margin, the
    // zones of its file, and the ways of stations that move: hollow where they end.
    flight({ places, speeds, top, shades, track, waypoints, margin, zones, moving }) {
      this.route.clearLayers();
      Object.assign(this, { top, shades, waypoints, lines: [places, ...margin] });
      const line = (points, className, more = {}) =>
        L.polyline(points, { className, interactive: false, ...more }).addTo(this.route);
      for (const ring of margin) line(ring, "margin");
      for (const [inclusion, ring] of zones) line(ring, zone_class(inclusion), { fill: !inclusion, smoothFactor: 0.2 });
      const shade = (k) => Math.round((SHADES * (speeds[k] + speeds[k + 1])) / (2 * top));
      for (let k = 0, from = 0; k + 1 < places.length; k++) {
        if (k + 2 < places.length && shade(k + 1) === shade(k)) continue;
        line(places.slice(from, k + 2), "route", { color: colour(shades, shade(k) / SHADES), weight: 5 });
        from = k + 1;
      }
      if (track.length) line(track, "track");
      this.ways = moving.flatMap(([, way]) => way);
      this.lines.push(...moving.map(([, way]) => way));
      for (const [kind, way] of moving) {
        line(way, "moving");
        const [from, to] = way.slice(-2).map((at) => this.map.latLngToContainerPoint(at));
        const turned = `rotate(${Math.atan2(to.y - from.y, to.x - from.x)}rad)`;
        const title = `${{ base: "Base station", user: "User" }[kind]} at the end`;
        const html = `<i style="transform: ${turned}">➤</i><span>${title}</span>`;
        L.circleMarker(way[0], { radius: 4, className: "moving", interactive: false }).addTo(this.route);
        L.marker(way.at(-1), { icon: L.divIcon({ className: `mark mark-${kind} mark-later`, html, iconSize: [18, 18] }), title, interactive: false, keyboard: false }).addTo(this.route);
      }
      this.show_waypoints();
      this.show_key();
      this.$el.dataset.drawn = Number(this.$el.dataset.drawn ?? 0) + 1;
    },
    // A dot at each waypoint, and its number beside it where that covers no line, mark or number.
    show_waypoints() {
      this.dots.clearLayers();
      const on_screen = (place) => this.map.latLngToContainerPoint(place);
      const along = (places) => places.map(on_screen).flatMap((here, k, all) => {
        const way = (all[k + 1] ?? here).subtract(here), steps = Math.ceil(way.distanceTo([0, 0]) / 6) || 1; // 6 pixels each
        return Array.from({ length: steps }, (_, i) => here.add(way.multiplyBy(i / steps)));
      });
      const edges = this.shapes?.flatMap(({ corners }) => (corners ? [[...corners, corners[0]]] : [])) ?? [];
      const rims = this.shapes?.filter(({ center }) => center).flatMap(({ center, shape }) => {
        const middle = on_screen(center), radius = on_screen([center[0], shape.getBounds().getEast()]).x - middle.x;
        return Array.from({ length: 40 }, (_, k) => middle.add([radius * Math.cos(k * Math.PI / 20), radius * Math.sin(k * Math.PI / 20)]));
      }) ?? [];
      const lines = [...[...this.lines, ...edges].flatMap(along), ...rims];
      const marks = [...this.marks.getLayers(), ...this.route.getLayers()].filter((each) => each.options.title);
      const taken = marks.map((mark) => {
        const here = on_screen(mark.getLatLng());
        return L.bounds(here.subtract([12, 12]), here.add([24 + 8 * mark.options.title.length, 12]));
      });
      for (const [number, at] of this.waypoints) {
        const here = on_screen(at), half = L.point(4 + 3.5 * `${number}`.length, 9); // pixels, 3 of them clear
        const boxes = SIDES.map(([x, y]) => here.add([x * (half.x + 3), y * (half.y + 3)]));
        const free = boxes.map((middle) => L.bounds(middle.subtract(half), middle.add(half)));
        const box = free.find((each) => !taken.some((other) => other.intersects(each)) && !lines.some((place) => each.contains(place)));
        if (box) taken.push(box);
        const { x, y } = box ? box.getCenter().subtract(here) : {};
        const html = `<b></b>${box ? `<i style="left: ${x}px; top: ${y}px">${Number(number)}</i>` : ""}`;
        const dot = L.divIcon({ className: "waypoint", html, iconSize: [0, 0] });
        L.marker(at, { icon: dot, interactive: false, keyboard: false }).addTo(this.dots);
      }
    },
    clear_flight() {
      this.route.clearLayers();
      Object.assign(this, { top: null, lines: [], waypoints: [] });
      this.show_waypoints();
      this.show_key();
      this.aircraft.remove();
    },
    // What the lines on the map are: the speeds of the route, and each kind of line that is there.
    show_key() {
      const speeds = `0<b style="background: linear-gradient(to right, ${this.shades})"></b>${Number(this.top).toFixed(1)} m/s`;
      const there = (name) => (name === "flown" ? this.track.getLatLngs().length : this.$el.querySelector(`.leaflet-pane path.${name}`));
      const lines = Object.entries(LINES).filter(([name]) => there(name));
      const row = ([name, text]) => `<svg><path class="${name}" d="M0 4H22"/></svg>${text}`;
      const rows = [...(this.top ? [speeds] : []), ...lines.map(row)];
      this.$el.lastElementChild.innerHTML = rows.map((each) => `<div>${each}</div>`).join("");
    },
    place_aircraft(at) {
      if (at) this.aircraft.setLatLng(at).addTo(this.map);
      else this.aircraft.remove();
    },
    // Where a vehicle was: the line of a flight, and a point more of it with the vehicle there.
    flown(places) {
      this.vehicle.remove();
      this.track.setLatLngs(places).addTo(this.map);
      this.show_key();
    },
    flies(at) {
      this.track.addLatLng(at);
      this.vehicle.setLatLng(at).addTo(this.map);
      this.show_key();
    },
    focus(at) {
      this.map.setView(at, Math.max(this.map.getZoom(), 17));
      const ring = L.circleMarker(at, { radius: 16, className: "found", interactive: false }).addTo(this.map);
      setTimeout(() => ring.remove(), 2500);
    },
    background(map) {
      this.tiles?.remove();
      this.tiles = null;
      if (!map) return;
      const { url, attribution, deepest } = map;
      this.tiles = L.tileLayer(url, { attribution, maxZoom: 22, maxNativeZoom: deepest }).addTo(this.map);
    },
  },
};
