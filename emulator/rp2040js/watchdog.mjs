// The watchdog's reset. rp2040js calls a handler, and does nothing itself.

const PSM = 0x40010;
const WATCHDOG = 0x40058;
const FORCED = 2;
// PSM.WDSEL: whether the watchdog resets the first core.
const PROC0 = 1 << 15;

export class Watchdog {
  constructor(machine, rp2040, before) {
    this.watchdog = rp2040.peripherals[WATCHDOG];
    if (before !== undefined) {
      this.watchdog.scratchData = before.watchdog.scratchData;
      this.watchdog.reason = before.watchdog.reason;
    }
    this.watchdog.onWatchdogTrigger = () => {
      if (rp2040.peripherals[PSM].wdsel & PROC0) {
        machine.bite = { isForced: this.watchdog.reason === FORCED, isOfCoreAlone: false };
      } else {
        machine.fault(rp2040.core.PC, 'the watchdog fired, but PSM.WDSEL does not let it reset the core');
      }
    };
  }
}
