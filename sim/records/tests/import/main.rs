//! Logs of other tools, taken as experiments. One program, since each takes seconds to link.

mod blackbox;
mod cases;
mod dataflash;
mod formats;
mod importing;
mod known;
mod mat;
mod odd;
mod plain;
mod redacted;
mod ulog;
mod unstated;
