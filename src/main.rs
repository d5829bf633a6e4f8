//! The firmware of the controller: wires the library to the STM32F405.
//!
//! On a host the same binary prints the pin-out, the defaults and the messages of the link.
#![cfg_attr(target_os = "none", no_std, no_main)]

mod board;

#[cfg(not(target_os = "none"))]
fn main() {
    println!("Pins of the STM32F405RG");
    for pin in &board::pinout::PINS {
        println!("  {:<5} {:<10} {}", pin.name, pin.function, pin.use_);
    }
    println!("\nInterrupts, highest priority first");
    for (name, what) in board::pinout::INTERRUPTS {
        println!("  {name:<7} {what}");
    }
}

#[cfg(target_os = "none")]
#[rtic::app(device = stm32f4xx_hal::pac, peripherals = true)]
mod app {
    use defmt_rtt as _;
    use heapless::spsc::{Consumer, Producer, Queue};

    use crate::board::capture::Capture;
    use crate::board::control_timer::ControlTimer;
    use crate::board::outputs::Outputs;
    use crate::board::serial::Serial;
    use crate::board::{Board, Queues, Watchdog};

    #[shared]
    struct Shared {
        capture: Capture,
    }

    #[local]
    struct Local {
        control_timer: ControlTimer,
        outputs: Outputs,
        watchdog: Watchdog,
        missed: u32,
        serial: Option<Serial>,
        received: Consumer<'static, u8>,
        to_send: Producer<'static, u8>,
    }

    #[init(local = [receive_queue: Queue<u8, 512> = Queue::new(), send_queue: Queue<u8, 512> = Queue::new()])]
    fn init(mut cx: init::Context) -> (Shared, Local) {
        let (received_in, received) = cx.local.receive_queue.split();
        let (to_send, to_send_out) = cx.local.send_queue.split();
        let queues = Queues { received: received_in, to_send: to_send_out };
        let board = Board::new(cx.device, &mut cx.core, queues, 600);
        defmt::info!("started: {}, {}", board.start_reason, board.clocks);
        let Board { capture, outputs, mut control_timer, serial, mut watchdog, .. } = board;
        watchdog.tighten();
        control_timer.start();
        let local = Local { control_timer, outputs, watchdog, missed: 0, serial, received, to_send };
        (Shared { capture }, local)
    }

    #[idle(local = [received, to_send])]
    fn idle(cx: idle::Context) -> ! {
        loop {
            if let Some(byte) = cx.local.received.dequeue() {
                let _ = cx.local.to_send.enqueue(byte);
                rtic::pend(stm32f4xx_hal::pac::Interrupt::USART3);
            }
        }
    }

    #[task(binds = TIM2, priority = 4, shared = [capture])]
    fn capture(mut cx: capture::Context) {
        cx.shared.capture.lock(|capture| {
            let _ = capture.take();
        });
    }

    #[task(binds = TIM5, priority = 3, shared = [capture], local = [control_timer, outputs, watchdog, missed])]
    fn control(mut cx: control::Context) {
        cx.local.control_timer.acknowledge();
        cx.shared.capture.lock(|capture| capture.listen([true; 4]));
        #[cfg(feature = "planted-panic")]
        let _ = core::hint::black_box(&[1, 2, 3, 4])[core::hint::black_box(2)..][core::hint::black_box(1)];
        cx.local.watchdog.feed();
        if cx.local.control_timer.is_due() {
            *cx.local.missed = cx.local.missed.saturating_add(1);
        }
    }

    #[task(binds = USART3, priority = 2, local = [serial])]
    fn link_byte(cx: link_byte::Context) {
        if let Some(serial) = cx.local.serial {
            serial.exchange();
        }
    }
}
