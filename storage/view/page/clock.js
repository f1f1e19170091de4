"use strict";
// One clock for the video and the world. While the video plays, the frame that the browser presents is the frame of the
// world; after a jump both change when the video has arrived. Without a video (a browser without H.264) a timer runs.

class Clock {
  // `changed()` is called when another frame is shown, or playing starts or stops.
  constructor(recording, video, changed) {
    this.recording = recording;
    this.video = video;
    this.changed = changed;
    this.frame = 0; // what video and world show
    this.wanted = 0; // where the user has jumped to; the video is on its way
    this.playing = false;
    this.speed = 1;
    this.arrived = null;
    if (!video) return;
    video.addEventListener("seeked", () => this.seeked());
    video.addEventListener("ended", () => this.pause());
    video.addEventListener("pause", () => this.pause());
    this.follow();
  }

  follow() {
    const { video } = this;
    if (video.requestVideoFrameCallback) {
      const presented = (_, about) => {
        if (this.playing) this.show(this.recording.frameAt(about.mediaTime));
        video.requestVideoFrameCallback(presented);
      };
      video.requestVideoFrameCallback(presented);
    } else {
      const look = () => {
        if (this.playing) this.show(this.recording.frameAt(video.currentTime));
        requestAnimationFrame(look);
      };
      look();
    }
  }

  show(frame) {
    this.frame = this.wanted = frame;
    this.changed();
  }

  play() {
    if (this.playing) return;
    if (this.frame === this.recording.count - 1) this.seek(0);
    this.playing = true;
    if (this.video) {
      this.video.playbackRate = this.speed;
      this.video.play().catch(() => this.pause());
    } else {
      this.begin();
    }
    this.changed();
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    if (this.video) this.video.pause();
    this.seek(this.frame);
    this.changed();
  }

  setSpeed(speed) {
    this.speed = speed;
    if (this.video) this.video.playbackRate = speed;
    else if (this.playing) this.begin();
  }

  // Jump to a frame; the promise is kept when video and world show it.
  seek(frame) {
    this.wanted = Math.max(0, Math.min(this.recording.count - 1, Math.round(frame)));
    if (!this.video) {
      this.show(this.wanted);
      if (this.playing) this.begin();
      return Promise.resolve();
    }
    const promise = new Promise((resolve) => {
      const before = this.arrived;
      this.arrived = () => {
        before?.();
        resolve();
      };
    });
    if (!this.video.seeking) this.start();
    this.changed();
    return promise;
  }

  start() {
    const { time } = this.recording;
    const begins = time[this.wanted], ends = this.recording.endOf(this.wanted);
    this.started = this.wanted;
    this.video.currentTime = begins + Math.min((ends - begins) / 2, 0.02); // inside the frame, whatever is rounded
  }

  seeked() {
    if (this.wanted !== this.started) {
      this.start(); // the user has moved on meanwhile
      return;
    }
    this.show(this.started);
    const { arrived } = this;
    this.arrived = null;
    arrived?.();
  }

  // The timer that stands in for a video.
  begin() {
    const from = performance.now(), at = this.recording.time[this.frame];
    const run = (this.run = {});
    const step = () => {
      if (!this.playing || this.run !== run) return;
      const seconds = at + ((performance.now() - from) / 1000) * this.speed;
      this.show(this.recording.frameAt(seconds));
      if (seconds >= this.recording.duration) this.pause();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }
}
