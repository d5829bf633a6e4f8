//! Opens what there is to see in the browser.

use std::path::Path;

use rotorlead_records::files::printable;

/// Opens an address. That there is no browser is said, and is no failure.
pub fn open_page(address: &str) {
    if open::that_detached(address).is_err() {
        eprintln!("No browser was found: open {} by hand.", printable(address));
    }
}

/// Opens a file, likewise.
pub fn open_file(path: &Path) {
    // What opens it may take a name with a hyphen in front for an option, and run elsewhere.
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    open_page(&path.to_string_lossy());
}
