// Skips the turns of a loop that only counts, or only waits for a pin: how a state machine measures a pulse.
//
// As long as the pin keeps its level and the counter lasts, every turn is like the one before. So the machine is not
// clocked; when something changes, it is brought to where it would be.

const JMP = 0;
const ALWAYS = 0;
const X_DECREMENT = 2;
const Y_DECREMENT = 4;
const PIN = 6;
// Instructions of a loop that is looked for.
const LONGEST = 4;

export class Spin {
  constructor(lane, block) {
    this.lane = lane;
    this.block = block;
    this.turns = 0;
    this.loop = null;
    this.forget();
  }

  // The loops that are known, by the level of the pin and the first instruction.
  forget() {
    this.known = [new Array(32), new Array(32)];
  }

  // Looks for a loop from the next instruction on, and starts to skip its turns.
  begin() {
    const { lane } = this;
    const { machine } = lane;
    if (this.block.instructions[machine.pc] >>> 13 !== JMP) {
      return;
    }
    const known = this.known[this.pinLevel()];
    known[machine.pc] ??= this.find(machine.pc) ?? { clocks: 0 };
    const loop = known[machine.pc];
    const turns = loop.clocks === 0 ? 0 : Math.min(lasts(machine.x, loop.x), lasts(machine.y, loop.y));
    if (turns > 1) {
      this.loop = loop;
      this.turns = turns;
      this.start = lane.due;
      lane.due += turns * loop.clocks * lane.divider;
    }
  }

  pinLevel() {
    const { gpio } = this.lane.machine.rp2040;
    const { jmpPin } = this.lane.machine;
    return jmpPin < gpio.length && gpio[jmpPin].inputValue ? 1 : 0;
  }

  // The loop that starts at an instruction: its length, and how often a turn decrements X and Y.
  find(start) {
    const { machine } = this.lane;
    if (machine.sidesetCount !== 0) {
      return null;
    }
    const loop = { clocks: 0, x: 0, y: 0 };
    let pc = start;
    for (let count = 0; count < LONGEST; count++) {
      const opcode = this.block.instructions[pc];
      const condition = (opcode >> 5) & 7;
      if (opcode >>> 13 !== JMP || ![ALWAYS, X_DECREMENT, Y_DECREMENT, PIN].includes(condition)) {
        return null;
      }
      loop.clocks += 1 + ((opcode >> 8) & 0x1f);
      loop.x += condition === X_DECREMENT ? 1 : 0;
      loop.y += condition === Y_DECREMENT ? 1 : 0;
      const isTaken = condition !== PIN || this.pinLevel() === 1;
      pc = isTaken ? opcode & 0x1f : pc === machine.wrapTop ? machine.wrapBottom : (pc + 1) & 0x1f;
      if (pc === start) {
        return loop;
      }
    }
    return null;
  }

  dependsOn(pin) {
    return this.turns !== 0 && this.lane.machine.jmpPin === pin;
  }

  // Brings the machine up to date, with everything that it does before the cycle `pio.from`.
  end() {
    if (this.turns === 0) {
      return;
    }
    const { lane, loop } = this;
    const now = lane.pio.earliest;
    const turn = loop.clocks * lane.divider;
    this.finish(Math.min(this.turns, Math.max(Math.floor((now - this.start) / turn), 0)));
    while (lane.due < now) {
      lane.due += lane.step() * lane.divider;
    }
  }

  // Ends behind a number of turns.
  finish(turns) {
    const { lane, loop } = this;
    lane.due = this.start + turns * loop.clocks * lane.divider;
    lane.machine.x -= turns * loop.x;
    lane.machine.y -= turns * loop.y;
    this.turns = 0;
  }
}

// For how many turns a counter lasts.
function lasts(counter, step) {
  return step === 0 ? Infinity : Math.floor(counter / step);
}
