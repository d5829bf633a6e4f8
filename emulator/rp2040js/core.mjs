// The core: sleep, the time that an exception takes, and faults, none of which rp2040js models.

const HARD_FAULT = 3;
// From the request to the first instruction of the handler: Cortex-M0+ TRM, without wait states.
const EXCEPTION_ENTRY_CYCLES = 15;
const ROM_END = 0x4000;
// The breakpoint by which the firmware finds out whether a debugger is attached: boards/rp2040/src/postmortem.rs.
const DEBUGGER_PROBE = 0xdb;
// The register by which software, or a debugger, resets the core.
const AIRCR = 0xd0c;
const SYSRESETREQ = 1 << 2;

export class Core {
  constructor(machine, rp2040, rom) {
    this.machine = machine;
    this.cpu = rp2040.core;
    machine.handlers.watch(this.cpu);
    this.rom = rom;
    this.isAsleep = false;
    this.isLocked = false;
    this.fault = null;
    this.isProbed = false;
    this.watchRequests(rp2040.ppb);
    rp2040.onBreak = (code) => {
      if (code === DEBUGGER_PROBE) {
        this.isProbed = true;
      } else {
        this.blame(`BKPT or UDF ${code}`);
      }
    };
  }

  // A request resets this core alone (RP2040 datasheet, 2.4.2.9): peripherals, pins and the watchdog go on.
  watchRequests(ppb) {
    const write = ppb.writeUint32;
    ppb.writeUint32 = (offset, value) => {
      if (offset === AIRCR) {
        this.machine.bite = value & SYSRESETREQ ? { isForced: true, isOfCoreAlone: true } : this.machine.bite;
      } else {
        write.call(ppb, offset, value);
      }
    };
  }

  reset() {
    const { cpu, machine } = this;
    Object.assign(cpu, new cpu.constructor(cpu.rp2040));
    cpu.rp2040.ppb.reset();
    machine.handlers.forget();
    this.isAsleep = false;
    this.isLocked = false;
    this.fault = null;
  }

  // Whether the core waits: for an interrupt, or for ever after a fault in the handler of faults.
  sleeps() {
    if (this.isAsleep) {
      this.isAsleep = !this.isWoken();
    }
    return this.isAsleep || this.isLocked;
  }

  // Masked by PRIMASK or not, a pending interrupt ends the sleep.
  isWoken() {
    const { cpu } = this;
    const interrupts = cpu.pendingInterrupts & cpu.enabledInterrupts;
    return interrupts !== 0 || cpu.pendingSystick || cpu.pendingPendSV || cpu.pendingSVCall;
  }

  // Executes an instruction, or enters an exception. Returns the cycles that it takes.
  step() {
    const { cpu, machine } = this;
    if (cpu.interruptsUpdated && cpu.checkForInterrupts()) {
      return EXCEPTION_ENTRY_CYCLES;
    }
    const pc = (cpu.PC & ~1) >>> 0;
    if (pc < ROM_END) {
      return this.rom.call(this, pc);
    }
    const cycles = cpu.executeInstruction();
    if (machine.handlers.isReturning) {
      machine.handlers.leave(machine.now + cycles);
    }
    if (cpu.waiting) {
      // rp2040js would take the interrupt that ends the sleep whatever PRIMASK says.
      cpu.waiting = false;
      this.isAsleep = true;
    }
    if (this.isProbed) {
      return cycles + this.answerProbe(pc);
    }
    return this.fault === null ? cycles : cycles + this.enterHardFault(pc);
  }

  // A breakpoint halts the core where a debugger is attached, and is a fault where none is: one that the firmware expects.
  answerProbe(pc) {
    this.isProbed = false;
    if (this.machine.request.is_debugged) {
      this.isLocked = true;
      return 0;
    }
    this.cpu.PC = pc;
    this.cpu.exceptionEntry(HARD_FAULT);
    return EXCEPTION_ENTRY_CYCLES;
  }

  // Makes the instruction that is executed fault.
  blame(what) {
    this.fault ??= what;
  }

  enterHardFault(pc) {
    const { cpu, machine } = this;
    const isInHandler = cpu.IPSR === HARD_FAULT;
    machine.fault(pc, isInHandler ? `lockup: ${this.fault}` : this.fault);
    this.fault = null;
    if (isInHandler) {
      this.isLocked = true;
      return 0;
    }
    cpu.PC = pc;
    cpu.exceptionEntry(HARD_FAULT);
    // Where the stack has left memory nothing is pushed, and the handler is entered all the same.
    this.fault = null;
    return EXCEPTION_ENTRY_CYCLES;
  }
}
