//! Debian's package manager, for what cargo has not got.

use std::path::Path;
use std::time::Duration;

use crate::run::{Result, command, output, run_within};

/// Longest that fetching the lists of packages may take.
const UPDATE_LIMIT: Duration = Duration::from_secs(300);
/// Longest that an installation may take.
const INSTALL_LIMIT: Duration = Duration::from_secs(900);
/// Where the machine's archives are named, and the file that this adds.
const SOURCES: &str = "/etc/apt/sources.list.d";
const ADDED: &str = "rotorlead-backports.sources";

/// One version of a package that the machine's archives offer.
#[derive(Debug, PartialEq, Eq)]
struct Offer {
    /// Upstream's major version.
    major: u32,
    /// Suite that has it, such as `bookworm-backports`.
    suite: String,
}

/// Installs `package` in version `major` or later, from the backports of the machine's own archive if need be.
pub fn install_at_least(package: &str, major: u32) -> Result {
    let by_hand = format!("install the package {package}, version {major} or later, by hand");
    permitted().map_err(|error| format!("{error}: {by_hand}"))?;
    if best(package, major).is_none() {
        update()?;
    }
    if best(package, major).is_none() {
        add_backports().map_err(|error| format!("{error}: {by_hand}"))?;
        update()?;
    }
    let offer = best(package, major).ok_or_else(|| format!("no archive of this machine has it: {by_hand}"))?;
    apt_get(&["install", "--yes", "--no-install-recommends", "--target-release", &offer.suite, package], INSTALL_LIMIT)
        .map_err(|error| format!("{error}: {by_hand}"))
}

/// Installs packages in whatever version there is.
pub fn install(packages: &[&str]) -> Result {
    let by_hand = format!("install by hand: {}", packages.join(" "));
    permitted().map_err(|error| format!("{error}: {by_hand}"))?;
    update()?;
    let arguments: Vec<&str> =
        ["install", "--yes", "--no-install-recommends"].iter().chain(packages).copied().collect();
    apt_get(&arguments, INSTALL_LIMIT).map_err(|error| format!("{error}: {by_hand}"))
}

/// Whether this may install anything at all.
fn permitted() -> Result {
    if output(&mut command("apt-get", &["--version"])).is_none() {
        return Err("there is no apt-get here".to_owned());
    }
    match output(&mut command("id", &["-u"])) {
        Some(user) if user.trim() == "0" => Ok(()),
        _ => Err("only root may install packages".to_owned()),
    }
}

fn update() -> Result {
    apt_get(&["update"], UPDATE_LIMIT)
}

fn apt_get(arguments: &[&str], limit: Duration) -> Result {
    run_within(command("apt-get", arguments).env("DEBIAN_FRONTEND", "noninteractive"), limit)
}

fn best(package: &str, major: u32) -> Option<Offer> {
    let listing = output(&mut command("apt-cache", &["madison", package]))?;
    offers(&listing).into_iter().filter(|offer| offer.major >= major).max_by_key(|offer| offer.major)
}

/// Reads `apt-cache madison`: `package | epoch:version | archive suite/component architecture Packages`.
fn offers(listing: &str) -> Vec<Offer> {
    let offer = |line: &str| {
        let mut fields = line.split('|').skip(1).map(str::trim);
        let version = fields.next()?;
        let upstream = version.split_once(':').map_or(version, |(_, version)| version);
        let major = upstream.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()?;
        let (suite, _) = fields.next()?.split_whitespace().nth(1)?.split_once('/')?;
        Some(Offer { major, suite: suite.to_owned() })
    };
    listing.lines().filter_map(offer).collect()
}

/// Adds the backports of the archive that the machine already uses.
fn add_backports() -> Result {
    let release = std::fs::read_to_string("/etc/os-release").map_err(|error| format!("/etc/os-release: {error}"))?;
    let codename = codename(&release).ok_or("/etc/os-release names no VERSION_CODENAME")?;
    let mut sources = vec!["/etc/apt/sources.list".into()];
    if let Ok(folder) = std::fs::read_dir(SOURCES) {
        sources.extend(folder.filter_map(|entry| entry.ok().map(|entry| entry.path())));
    }
    let archive = sources
        .iter()
        .filter_map(|path| std::fs::read_to_string(path).ok())
        .find_map(|text| archive(&text, codename))
        .ok_or_else(|| format!("no archive with the suite {codename} in /etc/apt"))?;
    let added = Path::new(SOURCES).join(ADDED);
    eprintln!("xtask: adds {codename}-backports of {} in {}", archive.address, added.display());
    std::fs::write(&added, archive.backports(codename)).map_err(|error| format!("{}: {error}", added.display()))
}

fn codename(release: &str) -> Option<&str> {
    release.lines().find_map(|line| line.strip_prefix("VERSION_CODENAME=")).map(|name| name.trim_matches('"'))
}

/// Where an archive is, and what its lists are signed with.
#[derive(Debug, PartialEq, Eq)]
struct Archive {
    address: String,
    signed_by: Option<String>,
}

impl Archive {
    fn backports(&self, codename: &str) -> String {
        let signed_by = self.signed_by.as_ref().map(|key| format!("Signed-By: {key}\n")).unwrap_or_default();
        format!("Types: deb\nURIs: {}\nSuites: {codename}-backports\nComponents: main\n{signed_by}", self.address)
    }
}

/// The archive that has the suite, in either of the two formats of source lists.
fn archive(text: &str, codename: &str) -> Option<Archive> {
    let one_line = text.lines().find_map(|line| {
        let rest = line.trim().strip_prefix("deb ")?;
        let (options, rest) = match rest.trim().strip_prefix('[').and_then(|rest| rest.split_once(']')) {
            Some((options, rest)) => (options, rest),
            None => ("", rest),
        };
        let mut fields = rest.split_whitespace();
        let address = fields.next()?.to_owned();
        let signed_by = options.split_whitespace().find_map(|option| option.strip_prefix("signed-by="));
        (fields.next()? == codename).then(|| Archive { address, signed_by: signed_by.map(str::to_owned) })
    });
    one_line.or_else(|| {
        text.split("\n\n").find_map(|paragraph| {
            let field = |name: &str| {
                paragraph.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':').map(str::trim))
            };
            let has_suite = field("Suites")?.split_whitespace().any(|suite| suite == codename);
            let address = field("URIs")?.split_whitespace().next()?.to_owned();
            has_suite.then(|| Archive { address, signed_by: field("Signed-By").map(str::to_owned) })
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_and_suites_are_read_from_what_apt_says() {
        let listing = "\
qemu-system-arm | 1:10.0.2+ds-2+deb13u1~bpo12+1 | http://deb.debian.org/debian bookworm-backports/main amd64 Packages
qemu-system-arm | 1:7.2+dfsg-7+deb12u18 | http://deb.debian.org/debian-security bookworm-security/main amd64 Packages
";
        let expected = [(10, "bookworm-backports"), (7, "bookworm-security")];
        assert_eq!(offers(listing), expected.map(|(major, suite)| Offer { major, suite: suite.to_owned() }));
        assert_eq!(offers("N: Unable to locate package\n"), []);
    }

    #[test]
    fn backports_come_from_the_archive_the_machine_has() {
        let paragraphs = "\
Types: deb
# a snapshot
URIs: http://mirror.example/debian
Suites: bookworm bookworm-updates
Components: main
Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg

Types: deb
URIs: http://mirror.example/debian-security
Suites: bookworm-security
Components: main
";
        let found = archive(paragraphs, "bookworm").unwrap();
        assert_eq!(found.address, "http://mirror.example/debian");
        let backports = found.backports("bookworm");
        assert!(backports.contains("Suites: bookworm-backports\n"), "{backports}");
        assert!(backports.contains("Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg\n"), "{backports}");
        assert_eq!(archive(paragraphs, "trixie"), None);

        let lines = "# comment\ndeb [arch=amd64 signed-by=/k.gpg] https://m.example/debian bookworm main contrib\n";
        let expected = Archive { address: "https://m.example/debian".into(), signed_by: Some("/k.gpg".into()) };
        assert_eq!(archive(lines, "bookworm"), Some(expected));
    }

    #[test]
    fn the_codename_is_read_with_and_without_quotes() {
        assert_eq!(codename("ID=debian\nVERSION_CODENAME=bookworm\n"), Some("bookworm"));
        assert_eq!(codename("VERSION_CODENAME=\"trixie\"\n"), Some("trixie"));
        assert_eq!(codename("ID=arch\n"), None);
    }
}
