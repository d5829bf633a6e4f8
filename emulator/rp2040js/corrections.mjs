// What rp2040js 1.4.1 gets wrong of the peripherals that the firmware uses.

const TIMER = 0x40054;
const XIP_CTRL = 0x14000;
const RESETS = 0x4000c;
const VREG_AND_CHIP_RESET = 0x40064;

export function correct(rp2040, { BasePeripheral, FIFO }) {
  correctTimer(rp2040.peripherals[TIMER]);
  correctSystick(rp2040.ppb);
  keepProtection(rp2040.ppb);
  correctVectors(rp2040);
  correctSoftwarePends(rp2040);
  correctPwm(rp2040.pwm);
  for (const block of rp2040.pio) {
    block.machines.forEach((machine) => joinFifos(machine, FIFO));
  }
  correctResets(rp2040.peripherals[RESETS]);
  rp2040.peripherals[VREG_AND_CHIP_RESET] = supply(new BasePeripheral(rp2040, 'VREG_AND_CHIP_RESET'));
  rp2040.peripherals[XIP_CTRL] = xipControl(new BasePeripheral(rp2040, 'XIP_CTRL'));
}

// Alarms come when the microsecond begins. rp2040js loses the part of a microsecond that has passed when one is set.
function correctTimer(timer) {
  const [ALARM0, ALARM3] = [0x10, 0x1c];
  const write = timer.writeUint32;
  timer.writeUint32 = (offset, value) => {
    write.call(timer, offset, value);
    if (offset >= ALARM0 && offset <= ALARM3) {
      const { nanos } = timer.clock;
      const micros = (value - Math.floor(nanos / 1000)) >>> 0;
      timer.alarms[(offset - ALARM0) / 4].clockAlarm.schedule(Math.max(micros * 1000 - (nanos % 1000), 0));
    }
  };
}

// SysTick counts the reload value and 0, too; a write of its value loads it without an interrupt.
function correctSystick(ppb) {
  const SYST_CVR = 0x018;
  const { systickAlarm, systickTimer } = ppb;
  const write = ppb.writeUint32;
  // The largest reload value, and one more.
  systickTimer.top = 0x1ffffff;
  const reload = () => systickTimer.set(ppb.systickReload + 1);
  const fire = systickAlarm.callback;
  systickAlarm.callback = () => {
    fire();
    reload();
  };
  ppb.writeUint32 = (offset, value) => {
    if (offset === SYST_CVR) {
      ppb.systickCountFlag = false;
      reload();
    } else {
      write.call(ppb, offset, value);
    }
  };
}

// A handler starts at its address, and not one byte behind: the lowest bit of a vector says Thumb. Code that adds the program
// counter to an offset, as tables of jumps do, would be off.
function correctVectors({ core }) {
  const enter = core.exceptionEntry;
  core.exceptionEntry = (number) => {
    enter.call(core, number);
    core.PC &= ~1;
  };
}

// The registers of the memory protection keep what is written. What they forbid below RAM faults without them, too.
function keepProtection(ppb) {
  const [FIRST, LAST] = [0xd90, 0xda0];
  const isProtection = (offset) => offset >= FIRST && offset <= LAST;
  const registers = {};
  const { readUint32, writeUint32 } = ppb;
  ppb.readUint32 = (offset) => (isProtection(offset) ? (registers[offset] ?? 0) : readUint32.call(ppb, offset));
  ppb.writeUint32 = (offset, value) => {
    if (isProtection(offset)) {
      registers[offset] = value;
    } else {
      writeUint32.call(ppb, offset, value);
    }
  };
}

// An interrupt that software has pended is taken once. rp2040js takes one that a peripheral may raise for ever.
function correctSoftwarePends({ core, ppb }) {
  const NVIC_ISPR = 0x200;
  const FIRST_INTERRUPT = 16;
  let pended = 0;
  const write = ppb.writeUint32;
  ppb.writeUint32 = (offset, value) => {
    pended |= offset === NVIC_ISPR ? value : 0;
    write.call(ppb, offset, value);
  };
  const enter = core.exceptionEntry;
  core.exceptionEntry = (number) => {
    const line = number >= FIRST_INTERRUPT ? pended & (1 << (number - FIRST_INTERRUPT)) : 0;
    core.pendingInterrupts &= ~line;
    pended &= ~line;
    enter.call(core, number);
  };
}

// A divider that is written starts a counter that is not enabled; the register EN reads 0; the outputs stay low up to
// the first wrap.
function correctPwm(pwm) {
  const [CHN_DIV, EN] = [0x04, 0xa0];
  const enabled = () => pwm.channels.reduce((bits, { csr }, index) => bits | ((csr & 1) << index), 0);
  const { readUint32, writeUint32 } = pwm;
  for (const channel of pwm.channels) {
    const write = channel.writeRegister;
    channel.writeRegister = (offset, value) => {
      write.call(channel, offset, value);
      if (offset === CHN_DIV) {
        channel.updateEnable();
      }
    };
  }
  pwm.readUint32 = (offset) => (offset === EN ? enabled() : readUint32.call(pwm, offset));
  pwm.writeUint32 = (offset, value) => {
    const before = enabled();
    writeUint32.call(pwm, offset, value);
    const started = enabled() & ~before;
    for (const channel of pwm.channels.filter(({ index }) => (started >> index) & 1)) {
      channel.setA(channel.timer.counter < channel.alarmA.target);
      channel.setB(channel.timer.counter < channel.alarmB.target);
    }
  };
}

// A state machine may have one FIFO of eight words instead of two of four.
function joinFifos(machine, FIFO) {
  const SHIFTCTRL = 0x08;
  const [JOIN_TX, JOIN_RX] = [1 << 30, 1 << 31];
  const write = machine.writeUint32;
  machine.writeUint32 = (offset, value) => {
    const changed = offset === SHIFTCTRL ? value ^ machine.shiftCtrl : 0;
    write.call(machine, offset, value);
    if (changed & (JOIN_TX | JOIN_RX)) {
      machine.txFIFO = new FIFO(value & JOIN_TX ? 8 : value & JOIN_RX ? 0 : 4);
      machine.rxFIFO = new FIFO(value & JOIN_RX ? 8 : value & JOIN_TX ? 0 : 4);
      machine.updateDMATx();
      machine.updateDMARx();
    }
  };
}

// Every peripheral is in reset at first, which rp2040js lets work all the same.
function correctResets(resets) {
  resets.reset = resets.reset_done;
  Object.defineProperty(resets, 'reset_done', { get: () => ~resets.reset & 0x1ffffff });
}

// The core's regulator and brown-out detector, which only keep what is written, and a chip that power has reset.
function supply(peripheral) {
  const HAD_POR = 1 << 8;
  const registers = [0xb1, 0x91, HAD_POR];
  peripheral.readUint32 = (offset) => registers[offset / 4];
  peripheral.writeUint32 = (offset, value) => (registers[offset / 4] = value);
  return peripheral;
}

// The cache's control: always flushed, its FIFO empty.
function xipControl(peripheral) {
  const READY = 3;
  peripheral.readUint32 = () => READY;
  peripheral.writeUint32 = () => {};
  return peripheral;
}
