// What shares a line with the chip and answers on it: `Responder` in `../src/rp2040`.

export class Responders {
  constructor(machine, responders) {
    this.machine = machine;
    this.listeners = responders.map(({ pin, falls, answers }) => ({ pin, falls, answers: [...answers], fallen: 0 }));
  }

  // The chip has let a line fall.
  fall(pin) {
    for (const listener of this.listeners) {
      if (listener.pin === pin && ++listener.fallen === listener.falls) {
        listener.fallen = 0;
        this.answer(pin, listener.answers.shift() ?? []);
      }
    }
  }

  answer(pin, steps) {
    const { now, stimuli } = this.machine;
    for (const { after, level } of steps) {
      stimuli.add(now + after, ({ chip }) => chip.pads.drive(pin, level));
    }
  }
}
