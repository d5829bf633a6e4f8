//! TIM5: the interrupt that runs the control task.

use stm32f4xx_hal::pac::TIM5;

/// The timer of the control task.
pub struct ControlTimer {
    timer: TIM5,
    timer_hz: u32,
}

impl ControlTimer {
    /// Does not run yet. The timer's clock has been switched on by [`super::clocks::measure`].
    pub fn new(timer: TIM5, timer_hz: u32) -> Self {
        timer.psc().write(|w| w.psc().set(0));
        // The update that a change of rate makes is not to be an interrupt.
        timer.cr1().modify(|_, w| w.urs().set_bit());
        Self { timer, timer_hz }
    }

    /// Ticks at `rate_hz` (at least 1), from 0.
    pub fn set_rate(&mut self, rate_hz: u32) {
        let rate_hz = rate_hz.max(1);
        let period = (self.timer_hz + rate_hz / 2) / rate_hz;
        self.timer.arr().write(|w| w.arr().set(period.saturating_sub(1)));
        self.timer.egr().write(|w| w.ug().set_bit());
    }

    /// Starts the ticks. The update comes last: QEMU's timer sets its alarm there, and goes on only if it finds interrupt
    /// and counter enabled when the alarm comes.
    pub fn start(&mut self) {
        self.timer.sr().write(|w| w.uif().clear_bit());
        self.timer.dier().write(|w| w.uie().set_bit());
        self.timer.cr1().modify(|_, w| w.cen().set_bit());
        self.timer.egr().write(|w| w.ug().set_bit());
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
