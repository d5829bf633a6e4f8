// The boot ROM's functions that write the flash, and the table that firmware finds them in. Of its code nothing is there.

const FLASH_START = 0x10000000;
const FLASH_END = 0x14000000;
const SECTOR = 4096;
const PAGE = 256;
// W25Q16JV, typical times at 125 MHz: a sector is erased in 45 ms, a page programmed in 0.4 ms.
const ERASE_CYCLES = 5_625_000;
const PROGRAM_CYCLES = 50_000;
const CALL_CYCLES = 100;

// Where the functions are said to be. No other address of the ROM may be called.
const LOOKUP = 0x100;
const FUNCTIONS = { IF: 0x200, EX: 0x204, RE: 0x208, RP: 0x20c, FC: 0x210, CX: 0x214 };
const TABLE = 0x300;

const SSI = 0x18000;
const SSIENR = 0x08;

export class Rom {
  constructor(machine, rp2040) {
    this.machine = machine;
    this.rp2040 = rp2040;
    // From the exit from execution in place to its return: the flash cannot be read.
    this.isFlashBusy = false;
    // "Mu", 1, version 2; then 16 bits each: the table of functions, that of data, the function that looks up.
    rp2040.bootrom.set([0x0201754d, TABLE | (TABLE << 16), LOOKUP | 1], 4);
    const ssi = rp2040.peripherals[SSI];
    const write = ssi.writeUint32;
    ssi.writeUint32 = (offset, value) => {
      write.call(ssi, offset, value);
      // A second stage of the boot that is run again ends with this.
      this.isFlashBusy &&= !(offset === SSIENR && value === 1);
    };
  }

  // Does what the function at `pc` does, and returns from it. Returns the cycles that it takes.
  call(core, pc) {
    const { cpu } = core;
    const [r0, r1, r2] = cpu.registers;
    let cycles = CALL_CYCLES;
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
      case FUNCTIONS.IF:
      case FUNCTIONS.FC:
        break;
      case FUNCTIONS.RE:
        this.check(core, r0, r1, SECTOR);
        this.write(r0, r1, () => 0xff);
        cycles = (r1 / SECTOR) * ERASE_CYCLES;
        break;
      case FUNCTIONS.RP:
        this.check(core, r0, r2, PAGE);
        // Programming clears bits only.
        this.write(r0, r2, (before, index) => before & this.rp2040.readUint8(r1 + index));
        cycles = (r2 / PAGE) * PROGRAM_CYCLES;
        break;
      default:
        core.blame(`call of the boot ROM at 0x${pc.toString(16)}, which is not there`);
    }
    cpu.PC = cpu.LR & ~1;
    return core.fault === null ? cycles : core.enterHardFault(pc);
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

  checkFetch(core, pc) {
    if (pc >= FLASH_START && pc < FLASH_END) {
      core.blame('an instruction was fetched from the flash while it was written');
    }
  }
}
