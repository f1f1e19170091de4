"use strict";
// Puts the page together: video, world, timeline, buttons, keys and numbers. `window.humanmm` is for scripts and tests.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
const PICK_PX = 45;
const element = (id) => document.getElementById(id);

function made(tag, parent, text, className) {
  const one = document.createElement(tag);
  if (text !== undefined) one.textContent = text; // names and messages are text, never markup
  if (className) one.className = className;
  parent.append(one);
  return one;
}

function colored(parent, color) {
  made("span", parent, undefined, "swatch").style.background = css(color);
}

function number(value, digits = 2) {
  return value.toFixed(digits).replace(/^-(?=0\.?0*$)/, "");
}

class Viewer {
  constructor(recording, video) {
    this.recording = recording;
    this.video = video;
    this.clock = new Clock(recording, video, () => this.changed());
    this.hover = null;
    this.openWorld();
    this.timeline = new Timeline(recording, element("timeline"), this.clock, (hover) => this.hovered(hover));
    this.writeFacts();
    this.makeButtons();
    this.listenToKeys();
    new ResizeObserver(() => this.resize()).observe(document.body);
    this.resize();
    this.choose("free");
  }

  openWorld() {
    const canvas = element("world");
    if (!canvas.getContext("webgl2", { antialias: true })) {
      element("no-world").hidden = false;
      return;
    }
    this.world = new World(this.recording, canvas, this.video);
    this.views = new Views(this.recording, this.world, canvas);
    this.views.controls.addEventListener("change", () => this.draw());
    canvas.addEventListener("pointermove", (event) => this.hovered(this.personUnder(event)));
    canvas.addEventListener("pointerleave", () => this.hovered(null));
  }

  // ---- what is fixed

  writeFacts() {
    const { recording } = this;
    const many = (count, one, more = `${one}s`) => `${count} ${count === 1 ? one : more}`;
    element("name").textContent = recording.name;
    element("facts").textContent =
      `${many(recording.count, "frame")} · ${number(recording.duration)} s · ${many(recording.shots.length, "shot")} · ` +
      many(recording.people.length, "person", "people");
    const warnings = element("warnings");
    made("h2", warnings, recording.warnings.length ? many(recording.warnings.length, "warning") : "no warnings");
    for (const { text, frame } of recording.warnings) {
      const row = made("p", warnings, text);
      if (frame === null) continue;
      row.classList.add("link");
      row.addEventListener("click", () => this.clock.seek(frame));
    }
    const table = element("people");
    this.rows = recording.people.map((person) => {
      const row = made("tr", table);
      const label = made("label", made("td", row));
      const box = made("input", label);
      box.type = "checkbox";
      box.checked = true;
      box.addEventListener("change", () => this.switchPerson(person, box.checked));
      colored(label, person.color);
      label.append(person.name);
      row.title = `probability ${Math.round(100 * person.probability)} % of being a person`;
      row.addEventListener("dblclick", () => this.followPerson(person));
      return { box, cells: ["state", "number", "number", "number", "number"].map((name) => made("td", row, "", name)) };
    });
  }

  makeButtons() {
    const speeds = element("speed");
    for (const speed of SPEEDS) made("option", speeds, `${speed} ×`).value = speed;
    speeds.value = 1;
    speeds.addEventListener("change", () => this.clock.setSpeed(Number(speeds.value)));
    element("play").addEventListener("click", () => this.toggle());
    for (const [id, step] of [["back", -1], ["on", 1]]) element(id).addEventListener("click", () => this.step(step));
    for (const [id, way] of [["cut-back", -1], ["cut-on", 1]]) element(id).addEventListener("click", () => this.toCut(way));
    this.buttons = MODES.map((mode, index) => {
      const button = made("button", element("modes"), mode);
      button.title = `key ${index + 1}`;
      button.addEventListener("click", () => this.choose(mode));
      return button;
    });
    const picture = element("picture");
    picture.addEventListener("change", () => {
      if (this.world) this.world.pictureShown = picture.checked;
      this.changed();
    });
    element("help").addEventListener("click", () => (element("keys").hidden = !element("keys").hidden));
    element("keys").addEventListener("click", () => (element("keys").hidden = true));
  }

  listenToKeys() {
    const keys = {
      " ": () => this.toggle(),
      ArrowLeft: (event) => this.step(event.shiftKey ? -10 : -1),
      ArrowRight: (event) => this.step(event.shiftKey ? 10 : 1),
      ArrowUp: () => this.toCut(-1),
      ArrowDown: () => this.toCut(1),
      Home: () => this.clock.seek(0),
      End: () => this.clock.seek(this.recording.count - 1),
      "-": () => this.changeSpeed(-1),
      "+": () => this.changeSpeed(1),
      p: () => element("picture").click(),
      "?": () => element("help").click(),
      Escape: () => (element("keys").hidden = true),
    };
    MODES.forEach((mode, index) => (keys[index + 1] = () => this.choose(mode)));
    window.addEventListener("keydown", (event) => {
      const act = keys[event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      if (document.activeElement instanceof HTMLElement) document.activeElement.blur();
      act(event);
    });
  }

  // ---- what the user does

  toggle() {
    if (this.clock.playing) this.clock.pause();
    else this.clock.play();
  }

  step(frames) {
    this.clock.pause();
    return this.clock.seek(this.clock.wanted + frames);
  }

  toCut(way) {
    const starts = this.recording.shots.map((shot) => shot.start);
    const from = this.clock.wanted;
    const next = way > 0 ? starts.find((start) => start > from) : starts.findLast((start) => start < from);
    return this.clock.seek(next ?? (way > 0 ? this.recording.count - 1 : 0));
  }

  changeSpeed(way) {
    const index = SPEEDS.indexOf(this.clock.speed) + way;
    if (!SPEEDS[index]) return;
    this.clock.setSpeed(SPEEDS[index]);
    element("speed").value = SPEEDS[index];
  }

  choose(mode) {
    if (!this.views) return;
    this.views.choose(mode, this.clock.frame);
    this.buttons.forEach((button, index) => button.classList.toggle("chosen", MODES[index] === mode));
    this.changed();
  }

  switchPerson(person, shown) {
    person.shown = shown;
    this.changed();
  }

  followPerson(person) {
    if (!this.views) return;
    this.views.followed = this.recording.people.indexOf(person);
    this.choose("follow");
  }

  // ---- what is shown

  resize() {
    const box = element("world").parentElement.getBoundingClientRect();
    if (this.world) {
      this.world.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
      this.world.renderer.setSize(box.width, box.height);
      this.views.resize(box.width, box.height);
    }
    this.timeline.resize(element("timeline").parentElement.clientWidth);
    this.changed();
  }

  changed() {
    if (!this.timeline?.still) return; // not put together yet
    const { frame } = this.clock;
    if (this.world) {
      this.views.show(frame);
      this.world.show(frame, this.views.mode === "shot");
    }
    element("play").textContent = this.clock.playing ? "❚❚" : "▶";
    this.timeline.draw();
    this.writeNumbers();
    this.draw();
  }

  // At most one picture for each of the screen.
  draw() {
    if (!this.world || this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.world.draw(this.views.camera);
    });
  }

  hovered(hover) {
    this.hover = hover;
    this.timeline.hover = hover?.frame;
    this.timeline.draw();
    this.writeNumbers();
  }

  personUnder(event) {
    const box = element("world").getBoundingClientRect(), { frame } = this.clock;
    let nearest = null, distance = PICK_PX;
    for (const body of this.world.bodies) {
      if (!body.mesh.visible) continue;
      for (const joint of body.joints()) {
        const on = this.views.onCanvas(joint.add(body.group.position));
        const away = on ? Math.hypot(on[0] - (event.clientX - box.left), on[1] - (event.clientY - box.top)) : Infinity;
        if (away < distance) [nearest, distance] = [body.person, away];
      }
    }
    return nearest && { frame, person: nearest };
  }

  writeNumbers() {
    const { recording, clock } = this;
    const { frame } = clock, shot = recording.shotAt(frame), index = recording.shotOf[frame];
    element("now").textContent = `frame ${frame}  ·  ${number(recording.time[frame], 3)} s  ·  shot ${index}`;
    this.rows.forEach(({ cells }, i) => {
      const person = recording.people[i], row = person.row(frame);
      const texts = row < 0 ? ["not there", "", "", "", ""] : [
        person.observed[row] ? "observed" : "filled in", ...Array.from(person.root(row), (value) => number(value)),
        number(person.speed(row), 1),
      ];
      cells.forEach((cell, k) => (cell.textContent = texts[k]));
    });
    element("shot").textContent = sentenceOf(recording, shot, index);
    element("under").textContent = this.hover ? this.underCursor(this.hover) : "";
  }

  underCursor({ frame, person }) {
    const { recording } = this;
    const words = [`frame ${frame}`, `${number(recording.time[frame], 3)} s`, `shot ${recording.shotOf[frame]}`];
    const row = person ? person.row(frame) : -1;
    if (row >= 0) {
      words.push(person.name, person.observed[row] ? "observed" : "filled in");
      words.push(`root (${Array.from(person.root(row), (value) => number(value)).join(", ")}) m`);
      words.push(`${number(person.speed(row))} m/s`);
    }
    return words.join("  ·  ");
  }
}

function sentenceOf(recording, shot, index) {
  const parts = [`Shot ${index}: ${shot.source} camera, frames ${shot.start} to ${shot.end - 1}.`];
  if (shot.failed) parts.push("A stage failed on it: its motion was filled in.");
  const { join } = shot;
  if (join && !join.linked) parts.push("Nothing places it relative to the shots before: it stands in a place of its own.");
  else if (join && join.probability !== null) {
    parts.push(`The camera's rotation over the cut before it is right within ${Math.round(join.uncertainty)}° (68 %), ` +
      `and the right one of all possible with ${Math.round(100 * join.probability)} %.`);
  }
  return parts.join(" ");
}

// The video of the page, ready to jump; null if this browser cannot play it.
function openVideo() {
  const base64 = element("video-data").textContent.trim(), video = element("video");
  if (!base64) return Promise.resolve(null);
  return new Promise((resolve) => {
    video.addEventListener("loadeddata", () => resolve(video), { once: true });
    video.addEventListener("error", () => resolve(null), { once: true });
    video.src = URL.createObjectURL(new Blob([bytesOf(base64)], { type: "video/mp4" }));
  });
}

const errors = [];
window.addEventListener("error", (event) => errors.push(event.message));
window.addEventListener("unhandledrejection", (event) => errors.push(String(event.reason)));

window.humanmm = {
  errors,
  ready: (async () => {
    const recording = new Recording(JSON.parse(element("recording").textContent));
    document.title = `${recording.name} · humanmm`;
    const video = await openVideo();
    if (!video) {
      element("video").hidden = true;
      element("no-video").hidden = false;
    }
    const viewer = new Viewer(recording, video);
    Object.assign(window.humanmm, {
      recording,
      viewer,
      seek: (frame) => viewer.clock.seek(frame),
      frame: () => viewer.clock.frame,
      choose: (mode) => viewer.choose(mode),
      // Joints of the n-th person as three.js has them: metres, world; and their pixels in the video.
      joints: (n) => viewer.world.bodies[n].joints().map((joint) => joint.toArray()),
      pixels: (n) => {
        const { group } = viewer.world.bodies[n];
        return viewer.world.bodies[n].joints().map((joint) => viewer.views.inVideo(joint.add(group.position)));
      },
    });
    return true;
  })(),
};
