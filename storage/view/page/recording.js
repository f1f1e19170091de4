"use strict";
// What the page shows: times, shots, cameras and people, unpacked from the JSON that storage/view/scene.py writes.
// World axes are those of motion.zarr: z up, metres, floor at z = 0.

const ARRAYS = { uint8: Uint8Array, uint16: Uint16Array, int16: Int16Array, float32: Float32Array, float64: Float64Array };
const SPEED_WINDOW_S = 0.2;
const CONTACT = 128; // of 255: from here on a foot stands on the floor

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

// A typed array, row after row; numbers are `scale` times what it holds.
function unpacked(packed) {
  return new ARRAYS[packed.dtype](bytesOf(packed.base64).buffer);
}

class Person {
  constructor(tree, time) {
    Object.assign(this, tree); // person, color, probability, place, first, restJoints
    for (const name of ["vertices", "pelvis", "turns", "observed", "contacts"]) this[name] = unpacked(tree[name]);
    this.scale = tree.vertices.scale;
    this.turnScale = tree.turns.scale;
    this.count = this.observed.length;
    this.name = `person ${this.person}`;
    this.time = time;
    this.shown = true;
  }

  // Row of the person's arrays for a frame of the video, or -1 where this person is not there.
  row(frame) {
    const row = frame - this.first;
    return row >= 0 && row < this.count ? row : -1;
  }

  root(row) {
    return this.pelvis.subarray(3 * row, 3 * row + 3);
  }

  stands(row, foot) {
    return this.contacts[4 * row + foot] >= CONTACT;
  }

  // Metres per second of the root around a row, over at most SPEED_WINDOW_S.
  speed(row) {
    let a = row, b = row;
    const seconds = (i) => this.time[this.first + i];
    while (a > 0 && seconds(row) - seconds(a - 1) <= SPEED_WINDOW_S / 2) a--;
    while (b < this.count - 1 && seconds(b + 1) - seconds(row) <= SPEED_WINDOW_S / 2) b++;
    if (a === b) return 0;
    const from = this.root(a), to = this.root(b);
    return Math.hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]) / (seconds(b) - seconds(a));
  }
}

class Recording {
  constructor(tree) {
    Object.assign(this, tree); // name, width, height, shots, places, warnings, body, parents, jointNames, contactJoints
    this.body = { faces: unpacked(tree.body.faces), joint: unpacked(tree.body.joint), weight: unpacked(tree.body.weight) };
    this.time = unpacked(tree.time);
    this.R = unpacked(tree.cameras.R);
    this.t = unpacked(tree.cameras.t);
    this.K = unpacked(tree.cameras.K);
    this.people = tree.people.map((person) => new Person(person, this.time));
    this.count = this.time.length;
    this.shotOf = new Uint16Array(this.count);
    tree.shots.forEach((shot, index) => this.shotOf.fill(index, shot.start, shot.end));
    const last = this.count > 1 ? this.time[this.count - 1] - this.time[this.count - 2] : 1 / 30;
    this.duration = this.time[this.count - 1] + last;
  }

  // The frame that is shown at a time: the last one that has begun.
  frameAt(seconds) {
    let low = 0, high = this.count - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.time[middle] <= seconds + 5e-4) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  // When a frame ends.
  endOf(frame) {
    return frame + 1 < this.count ? this.time[frame + 1] : this.duration;
  }

  shotAt(frame) {
    return this.shots[this.shotOf[frame]];
  }

  placeAt(frame) {
    return this.places[this.shotAt(frame).place];
  }
}

function runsOf(count, isTrue) {
  const runs = [];
  for (let i = 0; i < count; i++) {
    if (!isTrue(i)) continue;
    const start = i;
    while (i < count && isTrue(i)) i++;
    runs.push([start, i]);
  }
  return runs;
}
