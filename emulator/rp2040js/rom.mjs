// The boot ROM's functions that write the flash and call its loader, and the table that firmware finds them in. Of its code nothing is there.

const FLASH_START = 0x10000000;
const FLASH_END = 0x14000000;
const SECTOR = 4096;
const PAGE = 256;
// W25Q16JV, typical times at 125 MHz: a sector is erased in 45 ms, a page programmed in 0.4 ms.
const ERASE_CYCLES = 5_625_000;
const PROGRAM_CYCLES = 50_000;
const CALL_CYCLES = 100;
// Interrupts are taken while the ROM waits for the flash, so often.
const WAIT_CYCLES = 20;

// Where the functions are said to be. No other address of the ROM may be called.
const LOOKUP = 0x100;
const FUNCTIONS = { IF: 0x200, EX: 0x204, RE: 0x208, RP: 0x20c, FC: 0x210, CX: 0x214, UB: 0x218 };
const TABLE = 0x300;

const SSI = 0x18000;
const SSIENR = 0x08;

export class Rom {
  constructor(machine, rp2040) {
    this.machine = machine;
    this.rp2040 = rp2040;
    // From the exit from execution in place to its return: the flash cannot be read.
    this.isFlashBusy = false;
    // Cycles that are left of the operation that waits, and what it does at its end.
    this.left = 0;
    this.finish = null;
    // "Mu", 1, version 2; then 16 bits each: the table of functions, that of data, the function that looks up.
    rp2040.bootrom.set([0x0201754d, TABLE | (TABLE << 16), LOOKUP | 1], 4);
    const ssi = rp2040.peripherals[SSI];
    const write = ssi.writeUint32;
    ssi.writeUint32 = (offset, value) => {
      write.call(ssi, offset, value);
      // A second stage of the boot that is run again ends with this.
      this.isFlashBusy &&= !(offset === SSIENR && value === 1);
    };
    // Everything that is read of the flash: instructions, constants, vectors.
    for (const name of ['readUint32', 'readUint16', 'readUint8']) {
      const read = rp2040[name];
      rp2040[name] = (address) => {
        if (this.isFlashBusy && address >= FLASH_START && address < FLASH_END) {
          machine.chip.core.blame('the flash was read while it was written');
        }
        return read.call(rp2040, address);
      };
    }
  }

  // Does what the function at `pc` does, and returns from it. Returns the cycles that it takes, or the first of them.
  call(core, pc) {
    const { cpu } = core;
    if (this.left > 0) {
      return this.wait(core, pc);
    }
    const [r0, r1, r2] = cpu.registers;
    switch (pc) {
      case LOOKUP:
        cpu.registers[0] = FUNCTIONS[String.fromCharCode(r1 & 0xff, (r1 >> 8) & 0xff)] ?? 0;
        cpu.registers[0] |= cpu.registers[0] === 0 ? 0 : 1;
        break;
      case FUNCTIONS.EX:
        this.isFlashBusy = true;
        break;
      case FUNCTIONS.CX:
        this.isFlashBusy = false;
        break;
      case FUNCTIONS.UB:
        this.machine.bite = { isForLoader: true };
        return CALL_CYCLES;
      case FUNCTIONS.IF:
      case FUNCTIONS.FC:
        break;
      case FUNCTIONS.RE:
        this.check(core, r0, r1, SECTOR);
        this.left = (r1 / SECTOR) * ERASE_CYCLES;
        this.finish = () => this.write(r0, r1, () => 0xff);
        return this.wait(core, pc);
      case FUNCTIONS.RP:
        this.check(core, r0, r2, PAGE);
        // Programming clears bits only.
        this.left = (r2 / PAGE) * PROGRAM_CYCLES;
        this.finish = () =>
          this.write(r0, r2, (before, index) => before & this.rp2040.readUint8(r1 + index));
        return this.wait(core, pc);
      default:
        core.blame(`call of the boot ROM at 0x${pc.toString(16)}, which is not there`);
    }
    cpu.PC = cpu.LR & ~1;
    return core.fault === null ? CALL_CYCLES : core.enterHardFault(pc);
  }

  wait(core, pc) {
    if (core.fault !== null) {
      this.left = 0;
      return core.enterHardFault(pc);
    }
    this.left -= WAIT_CYCLES;
    if (this.left <= 0) {
      this.left = 0;
      this.finish();
      core.cpu.PC = core.cpu.LR & ~1;
    }
    return WAIT_CYCLES;
  }

  check(core, offset, count, unit) {
    if (!this.isFlashBusy) {
      core.blame('the flash was to be written before flash_exit_xip');
    } else if (offset % unit !== 0 || count % unit !== 0) {
      core.blame(`${count} bytes at 0x${offset.toString(16)} of the flash are not whole units of ${unit}`);
    }
  }

  // Changes bytes of the flash, up to where power is cut.
  write(offset, count, change) {
    const { machine, rp2040 } = this;
    const cut = machine.request.power_cut;
    machine.powerIsCut = cut !== null && machine.flashOperations === cut.operation;
    machine.flashOperations++;
    const length = machine.powerIsCut ? Math.min(cut.bytes, count) : count;
    for (let index = 0; index < length; index++) {
      rp2040.flash[offset + index] = change(rp2040.flash[offset + index], index);
    }
  }
}
