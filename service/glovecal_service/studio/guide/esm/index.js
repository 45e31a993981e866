// Tones without a file, and keys for hands in gloves: a foot pedal is a keyboard with one or two of them.

const TONES = { // Hz, start and length in seconds
  begin: [[880, 0, 0.16]],
  end: [[660, 0, 0.12]],
  good: [[880, 0, 0.11], [1320, 0.12, 0.2]],
  bad: [[330, 0, 0.18], [220, 0.2, 0.34]],
  lost: [[220, 0, 0.2], [220, 0.3, 0.2], [220, 0.6, 0.2]],
  done: [[660, 0, 0.14], [880, 0.15, 0.14], [1320, 0.3, 0.35]],
};
const LOUDNESS = 0.25;
const MUTED = "glovecal-muted";

/** Browsers give no sound before the first key or click on a page. */
export class Tones {
  constructor() {
    this.played = [];
    this.muted = localStorage.getItem(MUTED) === "yes";
    this.wake = () => this.context()?.resume();
    for (const kind of ["pointerdown", "keydown"]) document.addEventListener(kind, this.wake, true);
  }

  context() {
    if (!this.audio && window.AudioContext) this.audio = new AudioContext();
    return this.audio;
  }

  mute(muted) {
    this.muted = muted;
    localStorage.setItem(MUTED, muted ? "yes" : "no");
  }

  play(name) {
    if (this.muted || !TONES[name]) return;
    this.played.push(name);
    const audio = this.context();
    if (!audio || audio.state !== "running") return;
    for (const [hertz, after, seconds] of TONES[name]) {
      const at = audio.currentTime + after;
      const tone = new OscillatorNode(audio, { frequency: hertz });
      const gain = new GainNode(audio, { gain: 0 });
      gain.gain.setValueAtTime(0, at);
      gain.gain.linearRampToValueAtTime(LOUDNESS, at + 0.015); // without a click
      gain.gain.setValueAtTime(LOUDNESS, at + seconds - 0.03);
      gain.gain.linearRampToValueAtTime(0, at + seconds);
      tone.connect(gain).connect(audio.destination);
      tone.start(at);
      tone.stop(at + seconds + 0.02);
    }
  }

  close() {
    for (const kind of ["pointerdown", "keydown"]) document.removeEventListener(kind, this.wake, true);
    this.audio?.close();
  }
}

const TYPED_INTO = "input, textarea, select, [contenteditable], [role=combobox], [role=listbox], [role=dialog], .q-menu";
const PRESSED = "button, a[href], summary, [role=button], [role=tab], .q-expansion-item__container [tabindex]";

/** Calls `act` with what `keys` ({act: [key]}) names; returns how to stop listening. */
export function listenToKeys(keys, act) {
  const acts = new Map(Object.entries(keys).flatMap(([name, all]) => all.map((key) => [key, name])));
  const down = (event) => {
    const name = acts.get(event.key.length === 1 ? event.key.toLowerCase() : event.key);
    if (!name || event.ctrlKey || event.altKey || event.metaKey || event.defaultPrevented) return;
    if (event.target.closest?.(TYPED_INTO)) return;
    // A button that has the focus is pressed by Space and Enter itself.
    if ((event.key === " " || event.key === "Enter") && event.target.closest?.(PRESSED)) return;
    event.preventDefault();
    if (!event.repeat) act(name);
  };
  // A button clicked by mouse gives the focus back, else a pedal's Space would press it again.
  const click = (event) => {
    if (event.detail > 0 && event.target.closest?.("button")) document.activeElement?.blur();
  };
  document.addEventListener("keydown", down);
  document.addEventListener("click", click);
  return () => {
    document.removeEventListener("keydown", down);
    document.removeEventListener("click", click);
  };
}
