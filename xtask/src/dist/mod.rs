//! What a release is made of, in `target/dist`. Nothing is published, tagged or uploaded.

mod archive;
mod licenses;
mod program;
mod sbom;
mod trial;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use archive::Files;
pub use trial::run as try_it;

use crate::board::{self, Board};
use crate::run::{Result, files_below, remove, root, target_folder};
use crate::sum::sha256;
use crate::{book, firmware, packages, python, setup, web};

/// The package whose version is the release's.
const PACKAGE: &str = "rotorlead";
/// Packages of the page, and of the Python module.
const PAGE_PACKAGE: &str = "rotorlead-web";
const PYTHON_PACKAGE: &str = "rotorlead-python";
/// The project's own.
const LICENSE: &str = "LICENSE";
/// The sums of all files, as `sha256sum --check` takes them.
const SUMS: &str = "SHA256SUMS";

/// Everything that is made on this machine: the packages for a registry, the program for this machine, the Python package, the page, the
/// documentation, the images of the boards, the lists of what is linked, and the sums of all.
pub fn make() -> Result {
    setup::check()?;
    setup::dist()?;
    let (new, version) = (NewFolder::create()?, version()?);
    let folder = new.path();
    let host = program::host()?;
    let published = packages::published()?;
    timed("packages", || {
        let archives = packages::archives(&published, &["--no-verify"])?;
        archives.iter().try_for_each(|archive| copy(archive, &folder.join("crates")))
    })?;
    timed("images", || board::all()?.iter().try_for_each(|board| image(board, &version, folder)))?;
    timed("documentation", || {
        let mut files = Files::default();
        files.add("LICENSE", read(&root().join(LICENSE))?);
        files.add_folder("docs", &book::build()?)?;
        let top = format!("rotorlead-{version}-docs");
        write(&folder.join(format!("{top}.tar.gz")), &files.tar_gz(&top)?)
    })?;
    let page = timed("page", web::page)?;
    timed("page's archive", || {
        let mut files = Files::default();
        files.add("LICENSE", read(&root().join(LICENSE))?);
        files.add_folder("web", &page)?;
        files.add("THIRD-PARTY.txt", licenses::texts(PAGE_PACKAGE, web::TARGET)?);
        let top = format!("rotorlead-{version}-web");
        write(&folder.join(format!("{top}.tar.gz")), &files.tar_gz(&top)?)
    })?;
    timed("program", || program::archive(&host, &version, &page, folder))?;
    let python_sbom = folder.join(format!("rotorlead-{version}-python.cdx.json"));
    timed("lists of what is linked", || {
        write(&folder.join(format!("rotorlead-{version}.cdx.json")), &sbom::list(program::PACKAGE, &host)?)?;
        write(&folder.join(format!("rotorlead-{version}-web.cdx.json")), &sbom::list(PAGE_PACKAGE, web::TARGET)?)?;
        write(&python_sbom, &sbom::list(PYTHON_PACKAGE, &host)?)
    })?;
    timed("Python package", || python::release(&licenses::texts(PYTHON_PACKAGE, &host)?, &python_sbom, folder))?;
    sums(folder)?;
    new.replace()
}

/// Puts the program for another target among what is there of a release.
pub fn make_program(target: &str) -> Result {
    setup::dist()?;
    setup::add_system(target)?;
    let (folder, version) = (folder(), version()?);
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let page = timed("page", web::page)?;
    timed("program", || program::archive(target, &version, &page, &folder))?;
    sums(&folder)
}

/// A board's image in the forms that flash it, and the licenses and the list of what is in it.
fn image(board: &'static Board, version: &str, folder: &Path) -> Result {
    let (_, files) = firmware::build_files(board)?;
    let name = format!("rotorlead-{version}-{}", board.name);
    for path in files {
        let end = path.extension().unwrap_or_default().to_string_lossy();
        write(&folder.join(format!("{name}.{end}")), &read(&path)?)?;
    }
    write(&folder.join(format!("{name}-third-party.txt")), &licenses::texts(&board.package, &board.target)?)?;
    write(&folder.join(format!("{name}.cdx.json")), &sbom::list(&board.package, &board.target)?)
}

/// Writes the sums of all files in a folder and in its folders, and prints them.
fn sums(folder: &Path) -> Result {
    let mut lines = String::new();
    for name in names(folder)?.into_iter().filter(|name| name != SUMS) {
        let bytes = read(&folder.join(&name))?;
        println!("{:>11} {name}", bytes.len());
        lines += &format!("{}  {name}\n", sha256(&bytes));
    }
    write(&folder.join(SUMS), lines.as_bytes())
}

/// Names of the files in a folder and in its folders, with `/` between.
fn names(folder: &Path) -> Result<Vec<String>> {
    let name = |path: PathBuf| path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().replace('\\', "/");
    Ok(files_below(folder)?.into_iter().map(name).collect())
}

/// Where a release is.
fn folder() -> PathBuf {
    target_folder().join("dist")
}

/// A release that is being made. The last one stays until this one is whole.
struct NewFolder(PathBuf);

impl NewFolder {
    fn create() -> Result<Self> {
        let folder = target_folder().join("dist-new");
        remove(&folder)?;
        fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        Ok(Self(folder))
    }

    fn path(&self) -> &Path {
        &self.0
    }

    /// Puts it in the place of the last one.
    fn replace(self) -> Result {
        remove(&folder())?;
        fs::rename(&self.0, folder()).map_err(|error| format!("{}: {error}", folder().display()))?;
        println!("{}", folder().display());
        Ok(())
    }
}

fn version() -> Result<String> {
    Ok(packages::version(&packages::manifest(PACKAGE)?).to_owned())
}

/// Runs a step, and says how long it took.
fn timed<T>(name: &str, step: impl FnOnce() -> Result<T>) -> Result<T> {
    let start = Instant::now();
    let result = step()?;
    println!("{:>6.0} s  {name}", start.elapsed().as_secs_f64());
    Ok(result)
}

fn copy(file: &Path, folder: &Path) -> Result {
    fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    write(&folder.join(file.file_name().unwrap_or_default()), &read(file)?)
}

fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).map_err(|error| format!("{}: {error}", path.display()))
}

fn write(path: &Path, bytes: &[u8]) -> Result {
    fs::write(path, bytes).map_err(|error| format!("{}: {error}", path.display()))
}
