// What shares a line with the chip and answers on it: `Responder` in `../src/rp2040`.

// From an edge of the chip to its next one within a question, at most: longer than a bit of DShot at 150 kbit/s.
const SAME_QUESTION_CYCLES = 1250;

export class Responders {
  constructor(machine, responders) {
    this.machine = machine;
    const listener = ({ pin, falls, answers }) => ({ pin, falls, answers: answers && [...answers], fallen: 0, edges: [] });
    this.listeners = responders.map(listener);
  }

  // The chip has moved a line.
  edge(pin, isHigh) {
    for (const listener of this.listeners) {
      if (listener.pin === pin) {
        if (listener.answers === null) {
          this.listen(listener, isHigh);
        } else if (!isHigh && ++listener.fallen === listener.falls) {
          listener.fallen = 0;
          this.answer(pin, this.machine.now, listener.answers.shift() ?? []);
        }
      }
    }
  }

  // Asks once the question is over: its last rise ends its last bit.
  listen(listener, isHigh) {
    const { pin } = listener;
    const { now } = this.machine;
    const last = listener.edges.at(-1);
    if (last === undefined || now - last.cycle > SAME_QUESTION_CYCLES) {
      listener.edges = [];
    }
    if (listener.edges.length !== 0 || !isHigh) {
      listener.edges.push({ cycle: now, pin, is_high: isHigh });
    }
    if (listener.edges.length === 2 * listener.falls) {
      const [fall] = listener.edges.slice(-2);
      this.answer(pin, fall.cycle, this.machine.ask(listener.edges));
      listener.edges = [];
    }
  }

  // Steps that are counted from the question's last fall.
  answer(pin, from, steps) {
    const { stimuli } = this.machine;
    for (const { after, level } of steps) {
      stimuli.add(from + after, ({ chip }) => chip.pads.drive(pin, level));
    }
  }
}
