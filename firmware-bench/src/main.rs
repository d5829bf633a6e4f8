//! Filters side by side on the controller's core: what `cargo xtask bench --firmware` steps through in the emulator.
//!
//! Every filter has the same functions, of which each is called once and by address, so that the compiler may neither
//! inline them nor know their arguments. All run the same design, with the coefficients that their arithmetic can hold.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    println!(
        "This runs on the controller's core: `cargo xtask bench --firmware` builds it and counts its instructions."
    );
}

#[cfg(target_os = "none")]
mod probes;

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some(device) = stm32f4xx_hal::pac::Peripherals::take() {
        probes::run(&device.TIM2, &device.RCC);
    }
    loop {
        cortex_m::asm::nop();
    }
}

#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {
        cortex_m::asm::nop();
    }
}
