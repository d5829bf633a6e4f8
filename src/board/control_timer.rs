//! TIM5: the interrupt that runs the control task.

use stm32f4xx_hal::pac::TIM5;

/// Rate of the control task, the paper's.
pub const CONTROL_HZ: u32 = 5000;

/// The timer of the control task.
pub struct ControlTimer {
    timer: TIM5,
}

impl ControlTimer {
    /// Sets the rate; [`Self::start`] starts it. The timer's clock has been switched on by [`super::clocks::measure`].
    pub fn new(timer: TIM5, timer_hz: u32) -> Self {
        let period = (timer_hz + CONTROL_HZ / 2) / CONTROL_HZ;
        timer.psc().write(|w| w.psc().set(0));
        timer.arr().write(|w| w.arr().set(period.saturating_sub(1)));
        // The update that this makes loads the registers; it is not to be an interrupt.
        timer.cr1().modify(|_, w| w.urs().set_bit());
        timer.egr().write(|w| w.ug().set_bit());
        Self { timer }
    }

    /// Starts the ticks. The interrupt is enabled before the counter: QEMU's timer sets its alarm only then.
    pub fn start(&mut self) {
        self.timer.sr().write(|w| w.uif().clear_bit());
        self.timer.dier().write(|w| w.uie().set_bit());
        self.timer.cr1().modify(|_, w| w.cen().set_bit());
    }

    /// Begin of a tick.
    #[inline]
    pub fn acknowledge(&mut self) {
        self.timer.sr().write(|w| w.uif().clear_bit());
    }

    /// Whether the next tick has become due meanwhile: the deadline was missed.
    #[inline]
    pub fn is_due(&self) -> bool {
        self.timer.sr().read().uif().bit_is_set()
    }
}
