// Emulated time: executes the core, and between its instructions everything that has come due.

import { Chip, CYCLE_NS } from './chip.mjs';
import { Handlers } from './handlers.mjs';
import { Responders } from './responders.mjs';
import { Stimuli } from './stimuli.mjs';

export class Machine {
  // `ask` answers a question on a line of the chip.
  constructor(rp2040js, run, ask) {
    this.rp2040js = rp2040js;
    this.request = run;
    this.ask = ask;
    this.now = 0;
    this.forget();
    // When the boot ROM's loader was called.
    this.bootLoader = null;
    this.unmodelled = new Set();
    this.flashOperations = 0;
    this.powerIsCut = false;
    // A reset of the chip that waits for the end of the instruction.
    this.bite = null;
    this.stimuli = new Stimuli();
    this.responders = new Responders(this, run.responders);
    this.handlers = new Handlers(this, run.handlers_from);
    this.watched = run.watch.reduce((mask, pin) => mask | (1 << pin), 0);
    this.chip = new Chip(this, null);
    for (const { offset, bytes } of run.flash) {
      this.chip.rp2040.flash.set(bytes, offset);
    }
    this.chip.boot();
  }

  // What a trace has of its own run alone.
  forget() {
    this.edges = [];
    this.conflicts = [];
    this.uart = [];
    this.usb = [];
    this.usbSetUps = [];
    this.resets = [];
    this.faults = [];
  }

  run(run) {
    this.request = run;
    this.forget();
    this.stimuli.extend(run);
    const until = run.until_cycle;
    this.stimuli.apply(this);
    while (this.now < until && !this.powerIsCut) {
      const { core } = this.chip;
      if (core.sleeps()) {
        this.advance(Math.min(this.nextEvent(), until));
      } else {
        this.advance(this.now + core.step());
      }
      if (this.bite !== null) {
        this.restart();
      }
    }
  }

  // Cycle of whatever comes next by itself.
  nextEvent() {
    return Math.min(this.nextAlarm(), this.stimuli.next, this.chip.pio.next);
  }

  nextAlarm() {
    const { alarms, base } = this.chip;
    const alarm = alarms.nextAlarm;
    // A fractional divider may put an alarm between two cycles; the margin is for the rounding of nanoseconds.
    return alarm === null ? Infinity : base + Math.ceil(alarm.nanos / CYCLE_NS - 1e-6);
  }

  // Lets time pass, with everything that comes due on the way and at its end.
  advance(to) {
    const { chip, stimuli } = this;
    const { pio, alarms } = chip;
    // Mostly nothing comes: this is what the speed depends on.
    const first = alarms.nextAlarm;
    const isQuiet = first === null || first.nanos > (to + 1 - chip.base) * CYCLE_NS;
    if (isQuiet && to < stimuli.next && to < pio.next) {
      this.setNow(to);
      pio.from = to + 1;
      return;
    }
    for (;;) {
      const alarm = this.nextAlarm();
      const next = Math.min(alarm, stimuli.next, pio.next);
      if (next > to) {
        break;
      }
      // What was scheduled for the past by the instruction that just ended happens now.
      this.setNow(Math.max(next, this.now));
      pio.from = this.now;
      if (stimuli.next <= this.now) {
        stimuli.apply(this);
      }
      if (alarm <= this.now) {
        const first = alarms.nextAlarm;
        alarms.nextAlarm = first.next;
        first.callback();
        if (this.bite !== null) {
          return;
        }
      }
      if (pio.next <= this.now) {
        pio.clock(this.now);
      }
    }
    this.setNow(to);
    pio.from = to + 1;
  }

  setNow(cycle) {
    this.now = cycle;
    this.chip.alarms.nanosCounter = (cycle - this.chip.base) * CYCLE_NS;
  }

  edge(pin, isHigh, isDriven) {
    if (!isDriven) {
      this.responders.edge(pin, isHigh);
    }
    if ((this.watched >> pin) & 1) {
      this.edges.push({ cycle: this.now, pin, is_high: isHigh });
    }
  }

  conflict(pin) {
    this.conflicts.push({ cycle: this.now, pin });
  }

  fault(pc, what) {
    this.faults.push({ cycle: this.now, pc, what });
  }

  // The watchdog resets everything but memory, its own scratch registers, and the reason.
  restart() {
    const { isForced, isOfCoreAlone, isForLoader } = this.bite;
    this.bite = null;
    if (isForLoader) {
      // The loader goes on, which is not modelled, and the chip's pins are as after any reset.
      this.bootLoader = this.now;
      this.chip = new Chip(this, this.chip);
      this.chip.core.isLocked = true;
      return;
    }
    this.resets.push({ cycle: this.now, is_forced: isForced });
    if (isOfCoreAlone) {
      this.chip.core.reset();
    } else {
      this.chip = new Chip(this, this.chip);
    }
    this.chip.boot();
  }

  trace() {
    const { edges, conflicts, uart, usb, usbSetUps, bootLoader, resets, faults, chip, request, now } = this;
    const memory = request.memory.map(({ address, length }) => chip.read(address, length));
    const { flashOperations, powerIsCut, unmodelled } = this;
    return {
      cycles: now,
      edges,
      conflicts,
      uart,
      usb,
      usb_set_ups: usbSetUps,
      boot_loader: bootLoader,
      resets,
      faults,
      handlers: this.handlers.trace(),
      memory,
      flash_operations: flashOperations,
      power_is_cut: powerIsCut,
      unmodelled: [...unmodelled],
    };
  }
}
