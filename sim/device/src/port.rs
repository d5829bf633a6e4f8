//! Serial ports by their names, or TCP for the emulator.

use std::net::{TcpStream, ToSocketAddrs as _};

use rotorlead::link::USB_ID;
use serialport::{SerialPortInfo, SerialPortType};

use super::line::{READ_LIMIT, WRITE_LIMIT};
use super::{DeviceError, Port};

/// Opens `tcp:HOST:PORT`, or else the serial port of that name at `baud`.
///
/// # Errors
/// [`DeviceError::Open`].
pub fn open(address: &str, baud: u32) -> Result<Box<dyn Port>, DeviceError> {
    let failed = |reason: String| DeviceError::Open { address: address.to_owned(), reason };
    match address.strip_prefix("tcp:") {
        Some(host) => tcp(host).map(|stream| Box::new(stream) as Box<dyn Port>).map_err(|e| failed(e.to_string())),
        None => serialport::new(address, baud)
            .timeout(READ_LIMIT)
            .open()
            .map(|port| Box::new(port) as Box<dyn Port>)
            .map_err(|error| failed(error.to_string())),
    }
}

/// The serial port of the one controller that is plugged in by USB.
///
/// # Errors
/// [`DeviceError::NotPlugged`], [`DeviceError::SeveralPlugged`].
pub fn find() -> Result<String, DeviceError> {
    // Where the ports cannot be listed, there is none that could be found.
    choose(serialport::available_ports().unwrap_or_default())
}

fn choose(ports: Vec<SerialPortInfo>) -> Result<String, DeviceError> {
    let is_controller = |port: &SerialPortInfo| match &port.port_type {
        SerialPortType::UsbPort(usb) => (usb.vid, usb.pid) == USB_ID,
        _ => false,
    };
    // Of the two names that macOS has for a port, the other one waits for a modem to call.
    let ports = ports.into_iter().filter(|port| is_controller(port) && !port.port_name.starts_with("/dev/tty."));
    let mut ports: Vec<String> = ports.map(|port| port.port_name).collect();
    ports.sort();
    match ports.len() {
        0 => Err(DeviceError::NotPlugged),
        1 => Ok(ports.remove(0)),
        _ => Err(DeviceError::SeveralPlugged { ports }),
    }
}

fn tcp(host: &str) -> std::io::Result<TcpStream> {
    let mut last = std::io::Error::other("the name has no address");
    for address in host.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, WRITE_LIMIT) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                stream.set_read_timeout(Some(READ_LIMIT))?;
                stream.set_write_timeout(Some(WRITE_LIMIT))?;
                return Ok(stream);
            }
            Err(error) => last = error,
        }
    }
    Err(last)
}

#[cfg(test)]
mod tests {
    use serialport::UsbPortInfo;

    use super::*;

    fn port(name: &str, (vid, pid): (u16, u16)) -> SerialPortInfo {
        let usb = UsbPortInfo { vid, pid, serial_number: None, manufacturer: None, product: None };
        SerialPortInfo { port_name: name.to_owned(), port_type: SerialPortType::UsbPort(usb) }
    }

    #[test]
    fn the_controller_is_found_among_adapters_and_asked_for_where_it_is_not_the_only_one() {
        let adapter = || port("/dev/ttyUSB0", (0x0403, 0x6001));
        let modem = || SerialPortInfo { port_name: "/dev/ttyS0".to_owned(), port_type: SerialPortType::PciPort };
        assert!(matches!(choose(vec![adapter(), modem()]), Err(DeviceError::NotPlugged)));
        let one = || port("/dev/cu.usbmodem1", USB_ID);
        let found = choose(vec![adapter(), port("/dev/tty.usbmodem1", USB_ID), one()]);
        assert_eq!(found.unwrap(), "/dev/cu.usbmodem1");
        let several = choose(vec![port("COM7", USB_ID), port("COM3", USB_ID)]).unwrap_err();
        assert_eq!(several.to_string(), "several controllers may be plugged in by USB: COM3, COM7");
    }
}
