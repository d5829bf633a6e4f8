// Clocks the state machines of both PIO blocks, each by its own divider.
//
// rp2040js steps all of them from a timer of the host. Here a machine is clocked at its cycle, and one that waits is
// not clocked at all until what it waits for may have come.

import { Spin } from './spin.mjs';

// The dividers count 256ths of a cycle.
const PARTS = 256;
const CTRL = 0x000;
const SM0_CLKDIV = 0x0c8;
const LARGEST_INTEGER_DIVIDER = 0x10000;

export class Pio {
  constructor(rp2040) {
    // The next cycle at which a machine is clocked, and the first at which one that starts now may be.
    this.next = Infinity;
    this.from = 0;
    this.blocks = rp2040.pio;
    this.lanes = this.blocks.flatMap((block) => block.machines.map((machine) => new Lane(this, block, machine)));
    this.blocks.forEach((block, index) => this.take(block, this.lanes.slice(4 * index, 4 * index + 4)));
  }

  // Takes the clock of a block over.
  take(block, lanes) {
    const write = block.writeUint32;
    block.run = () => {};
    block.writeUint32 = (offset, value) => {
      const isFifo = offset >= 0x10 && offset < 0x20;
      if (!isFifo) {
        lanes.forEach((lane) => lane.registersChange());
      }
      write.call(block, offset, value);
      if (offset === CTRL) {
        lanes.forEach((lane, index) => lane.control(value >> index));
      } else if (offset >= SM0_CLKDIV) {
        lanes.forEach((lane) => lane.readDivider());
      }
      block.checkChangedPins();
      this.schedule();
    };
  }

  // `from` as the lanes count.
  get earliest() {
    return this.from * PARTS;
  }

  // Clocks every machine that is due.
  clock(now) {
    // What one machine does another sees in the cycle after.
    this.from = now + 1;
    const { lanes, blocks } = this;
    for (let index = 0; index < 8; index++) {
      const lane = lanes[index];
      if (lane.due <= now * PARTS) {
        lane.clock();
      }
    }
    blocks[0].checkChangedPins();
    blocks[1].checkChangedPins();
    this.schedule();
  }

  schedule() {
    let first = Infinity;
    const { lanes } = this;
    for (let index = 0; index < 8; index++) {
      if (lanes[index].due < first) {
        first = lanes[index].due;
      }
    }
    this.next = Math.ceil(first / PARTS);
  }

  // A machine that counts while a pin has a level is brought up to date before the level changes.
  pinChanges(pin) {
    for (const lane of this.lanes) {
      if (lane.spin.dependsOn(pin)) {
        lane.spin.end();
        this.schedule();
      }
    }
  }
}

// A state machine and its clock.
class Lane {
  constructor(pio, block, machine) {
    this.pio = pio;
    this.machine = machine;
    // 256ths of a cycle: the next clock, infinite while the machine stands; the phase of the clock; its period.
    this.due = Infinity;
    this.phase = 0;
    this.divider = PARTS;
    this.isClocked = false;
    this.spin = new Spin(this, block);
    this.check = machine.checkWait;
    machine.checkWait = () => this.wake();
    machine.clkDivRestart = () => {
      this.phase = pio.earliest;
    };
  }

  // Bits of CTRL: enable, restart, restart of the divider.
  control(bits) {
    const isEnabled = (bits & 1) !== 0;
    const isRestarted = (bits & (1 << 4 | 1 << 8)) !== 0;
    if (!isEnabled) {
      this.due = Infinity;
    } else if (isRestarted || this.due === Infinity) {
      this.start();
    }
  }

  readDivider() {
    const { clockDivInt, clockDivFrac } = this.machine;
    this.divider = (clockDivInt || LARGEST_INTEGER_DIVIDER) * PARTS + clockDivFrac;
  }

  // Clocks the machine from its next edge on.
  start() {
    const periods = Math.ceil((this.pio.earliest - this.phase) / this.divider);
    this.phase += Math.max(periods, 0) * this.divider;
    this.due = this.phase;
  }

  // What the machine waits for may have come.
  wake() {
    const { machine } = this;
    if (this.isClocked || !machine.enabled) {
      this.check.call(machine);
    } else if (machine.waiting && this.due === Infinity) {
      this.start();
      this.pio.schedule();
    }
  }

  // The registers are about to be written: what is known of the program may be wrong then.
  registersChange() {
    this.spin.end();
    this.spin.forget();
  }

  clock() {
    const { machine, spin } = this;
    if (spin.turns !== 0) {
      spin.finish(spin.turns);
    }
    this.phase = this.due + this.step() * this.divider;
    this.due = machine.waiting ? Infinity : this.phase;
    if (!machine.waiting) {
      spin.begin();
    }
  }

  // Executes an instruction, or looks whether its wait has ended. Returns the clocks that it takes.
  step() {
    const { machine } = this;
    const before = machine.cycles;
    this.isClocked = true;
    let clocks = 0;
    if (machine.waiting) {
      // The clock that ends a wait is that of its instruction; the delay follows.
      clocks = 1;
      this.check.call(machine);
    } else {
      machine.step();
    }
    this.isClocked = false;
    return clocks + machine.cycles - before;
  }
}
