"use strict";
// The rows along time: shots, how certain each cut is, warnings, and for every person where he was observed (solid) or
// filled in (hatched) and when his feet stood. A pointer moves the clock; under the cursor the numbers are told.

const GUTTER = 92, RIGHT = 14, AXIS = 18, SHOTS = 22, CUTS = 17, WARNINGS = 14, FOOT = 7;
const INK = "#d6dbe3", SOFT = "#8a93a0", LINE = "#2b313a", GOOD = "#57c98a", DOUBT = "#ffb454", BAD = "#ff5454";
const FEET = [["L", [0, 1]], ["R", [2, 3]]];
const SURE = 0.8, WITHIN_DEG = 30; // beyond these humanmm warns of a cut

function colorOfCut(join) {
  if (!join || join.probability === null || join.linked === false) return BAD;
  if (join.probability >= SURE && join.uncertainty <= WITHIN_DEG) return GOOD;
  return join.probability < 0.3 ? BAD : DOUBT;
}

function css(color) {
  return `#${color.toString(16).padStart(6, "0")}`;
}

class Timeline {
  constructor(recording, canvas, clock, hovered) {
    this.recording = recording;
    this.canvas = canvas;
    this.clock = clock;
    this.cuts = recording.shots.length > 1 ? CUTS : 0;
    this.warnings = recording.warnings.some((one) => one.frame !== null) ? WARNINGS : 0;
    this.rows = AXIS + SHOTS + this.cuts + this.warnings;
    this.person = recording.people.length > 3 ? 28 : 36;
    this.height = this.rows + this.person * recording.people.length + 4;
    let scrubbing = false;
    const frameOf = (event) => this.frameAt(event.clientX - canvas.getBoundingClientRect().left);
    canvas.addEventListener("pointerdown", (event) => {
      scrubbing = true;
      canvas.setPointerCapture(event.pointerId);
      clock.seek(frameOf(event));
    });
    canvas.addEventListener("pointermove", (event) => {
      if (scrubbing) clock.seek(frameOf(event));
      hovered({ frame: frameOf(event), person: this.personAt(event.clientY - canvas.getBoundingClientRect().top) });
    });
    canvas.addEventListener("pointerup", () => (scrubbing = false));
    canvas.addEventListener("pointerleave", () => hovered(null));
  }

  x(seconds) {
    return GUTTER + (seconds / this.recording.duration) * (this.width - GUTTER - RIGHT);
  }

  frameAt(x) {
    return this.recording.frameAt(((x - GUTTER) / (this.width - GUTTER - RIGHT)) * this.recording.duration);
  }

  personAt(y) {
    return this.recording.people[Math.floor((y - this.rows) / this.person)] ?? null;
  }

  resize(width) {
    this.width = width;
    const ratio = window.devicePixelRatio || 1;
    const still = document.createElement("canvas");
    for (const one of [still, this.canvas]) {
      one.width = Math.round(width * ratio);
      one.height = Math.round(this.height * ratio);
    }
    this.canvas.style.height = `${this.height}px`;
    this.ratio = ratio;
    this.still = still;
    const context = still.getContext("2d");
    context.scale(ratio, ratio);
    this.drawRows(context);
    this.draw();
  }

  // Everything but the cursor, drawn once.
  drawRows(context) {
    const { recording } = this;
    context.textBaseline = "middle";
    this.drawAxis(context);
    this.drawShots(context, AXIS);
    const cuts = AXIS + SHOTS, warnings = cuts + this.cuts;
    if (this.cuts) this.name(context, "cuts", cuts + CUTS / 2, SOFT);
    for (const shot of recording.shots.slice(1)) this.drawCut(context, shot, cuts);
    if (this.warnings) this.name(context, "warnings", warnings + WARNINGS / 2, SOFT);
    for (const { frame } of recording.warnings) if (frame !== null) this.drawWarning(context, frame, warnings);
    recording.people.forEach((person, index) => this.drawPerson(context, person, this.rows + this.person * index));
  }

  name(context, text, y, color, size = 11, right = 8) {
    context.font = `${size}px system-ui, sans-serif`;
    context.textAlign = "right";
    context.fillStyle = color;
    context.fillText(text, GUTTER - right, y, GUTTER - right - 2);
  }

  drawAxis(context) {
    const { duration } = this.recording;
    const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 30, 60, 120, 300, 600, 1800, 3600];
    const step = steps.find((one) => (one / duration) * (this.width - GUTTER) > 64) ?? 3600;
    this.name(context, "seconds", AXIS / 2, SOFT);
    context.textAlign = "left";
    for (let at = 0; at <= duration; at += step) {
      const x = this.x(at);
      context.fillStyle = LINE;
      context.fillRect(x, 0, 1, this.height);
      context.fillStyle = SOFT;
      if (x < this.width - 30) context.fillText(String(Math.round(at * 10) / 10), x + 4, AXIS / 2);
    }
  }

  drawShots(context, y) {
    const { recording } = this;
    this.name(context, "shots", y + SHOTS / 2 - 1, INK);
    recording.shots.forEach((shot, index) => {
      const from = this.x(recording.time[shot.start]), to = this.x(recording.endOf(shot.end - 1));
      context.fillStyle = css(shot.color);
      context.fillRect(from, y, to - from, SHOTS - 3);
      if (shot.place > 0) hatch(context, from, y, to - from, SHOTS - 3, "rgb(0 0 0 / 0.35)");
      const long = `${index}  ${shot.source}${shot.place > 0 ? ", another place" : ""}`;
      const room = to - from - 8;
      context.font = "bold 11px system-ui, sans-serif";
      context.textAlign = "center";
      context.fillStyle = "#fff";
      const text = context.measureText(long).width < room ? long : String(index);
      if (context.measureText(text).width < room + 6) context.fillText(text, (from + to) / 2, y + SHOTS / 2 - 1);
    });
  }

  drawCut(context, shot, y) {
    const { recording } = this;
    const { transition } = shot;
    const x = this.x(recording.time[shot.start]);
    context.fillStyle = BAD;
    if (transition && transition.end > transition.start) {
      const from = this.x(recording.time[transition.start]);
      const to = this.x(recording.endOf(Math.min(transition.end, recording.count) - 1));
      hatch(context, from, AXIS, to - from, SHOTS - 3, BAD);
    }
    context.fillRect(x - 0.75, AXIS - 2, 1.5, SHOTS + 1);
    context.fillStyle = colorOfCut(shot.join);
    context.beginPath();
    context.arc(x, y + CUTS / 2, 4, 0, 2 * Math.PI);
    context.fill();
    const text = shot.join?.linked === false ? "apart" : certainty(shot.join);
    const room = this.x(recording.endOf(shot.end - 1)) - x - 14;
    context.font = "10px system-ui, sans-serif";
    context.textAlign = "left";
    if (context.measureText(text).width < room) context.fillText(text, x + 8, y + CUTS / 2 + 0.5);
  }

  drawWarning(context, frame, y) {
    const x = this.x(this.recording.time[frame]);
    context.fillStyle = DOUBT;
    context.beginPath();
    context.moveTo(x, y + 2);
    context.lineTo(x + 5, y + WARNINGS - 3);
    context.lineTo(x - 5, y + WARNINGS - 3);
    context.fill();
  }

  drawPerson(context, person, y) {
    const { recording } = this;
    const span = ([from, to], top, height) => {
      const x = this.x(recording.time[person.first + from]);
      return [x, top, Math.max(1, this.x(recording.endOf(person.first + to - 1)) - x), height];
    };
    const bar = this.person - 2 * FOOT - 7;
    context.fillStyle = LINE;
    context.fillRect(0, y, this.width, 1);
    this.name(context, person.probability < 0.5 ? `${person.name}?` : person.name, y + this.person / 2, css(person.color), 11, 20);
    context.fillStyle = css(person.color);
    for (const run of runsOf(person.count, (row) => person.observed[row])) context.fillRect(...span(run, y + 3, bar));
    for (const run of runsOf(person.count, (row) => !person.observed[row])) hatch(context, ...span(run, y + 3, bar), css(NOT_OBSERVED));
    FEET.forEach(([side, feet], index) => {
      const top = y + this.person - 2 * FOOT - 1 + FOOT * index;
      this.name(context, side, top + 2, SOFT, 8);
      context.fillStyle = "#3fae68";
      const stands = (row) => feet.some((foot) => person.stands(row, foot));
      for (const run of runsOf(person.count, stands)) context.fillRect(...span(run, top, 4));
    });
  }

  draw() {
    const context = this.canvas.getContext("2d");
    const { recording, clock, ratio } = this;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    context.drawImage(this.still, 0, 0);
    context.scale(ratio, ratio);
    const mark = (frame, color, width) => {
      const from = this.x(recording.time[frame]), to = this.x(recording.endOf(frame));
      context.fillStyle = color;
      context.fillRect((from + to) / 2 - width / 2, 2, width, this.height - 4);
    };
    if (this.hover !== undefined && this.hover !== null) mark(this.hover, "rgb(255 255 255 / 0.25)", 1);
    mark(clock.wanted, "#fff", 2);
  }
}

function certainty(join) {
  if (!join || join.probability === null) return "no figure";
  return `±${Math.round(join.uncertainty)}°  ${Math.round(100 * join.probability)} %`;
}

function hatch(context, x, y, width, height, color) {
  context.save();
  context.beginPath();
  context.rect(x, y, width, height);
  context.clip();
  context.strokeStyle = color;
  context.lineWidth = 2.2;
  context.beginPath();
  for (let at = x - height - (x % 6); at < x + width; at += 6) {
    context.moveTo(at, y + height);
    context.lineTo(at + height, y);
  }
  context.stroke();
  context.restore();
}
