//! What the built site must hold: each link leads to a page and a section that are there, and nothing is asked of another host.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use html5gum::{DefaultEmitter, Token, Tokenizer};

use crate::run::{Result, files_below};

/// Attributes by which a page names another file.
const LINKS: [&str; 6] = ["href", "src", "srcset", "poster", "data", "action"];
/// What every page holds: a browser then refuses what would go to another host, whatever asks for it.
const POLICY: &str = "default-src 'self' 'unsafe-inline' data:";

/// What of a page others may link to, and what it links to.
#[derive(Default)]
struct Page {
    sections: BTreeSet<String>,
    links: Vec<Link>,
    has_policy: bool,
}

struct Link {
    target: String,
    /// A link that a reader follows; a browser asks for what is in the others by itself.
    is_followed: bool,
}

/// An error with every link of the site that leads nowhere, and every request to another host. Gives the number of pages.
pub fn check(site: &Path) -> Result<usize> {
    let mut pages = BTreeMap::new();
    let mut errors = Vec::new();
    for path in files_below(site)? {
        let text = |path: &Path| fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()));
        let name = path.strip_prefix(site).unwrap_or(&path).to_string_lossy().into_owned();
        match path.extension().and_then(|end| end.to_str()) {
            Some("html") => drop(pages.insert(path.clone(), Page::read(&text(&path)?))),
            Some("css") => {
                errors.extend(foreign_urls(&text(&path)?).map(|url| format!("{name} asks another host: {url}")))
            }
            _ => {}
        }
    }
    for (path, page) in &pages {
        let name = path.strip_prefix(site).unwrap_or(path).display();
        // The table of contents for browsers without scripts is no page, and has no head of its own.
        if !page.has_policy && !path.ends_with("toc.html") {
            errors.push(format!("{name} does not forbid requests to other hosts: {POLICY}"));
        }
        for link in &page.links {
            if let Err(error) = link.check(path, &pages) {
                errors.push(format!("{name} links to {}: {error}", link.target));
            }
        }
    }
    if pages.is_empty() {
        errors.push(format!("{} has no page", site.display()));
    }
    if errors.is_empty() { Ok(pages.len()) } else { Err(errors.join("\n")) }
}

impl Page {
    fn read(html: &str) -> Self {
        let mut emitter = DefaultEmitter::default();
        emitter.naively_switch_states(true);
        let mut page = Self::default();
        for Ok(token) in Tokenizer::new_with_emitter(html, emitter) {
            let Token::StartTag(tag) = token else { continue };
            for (name, value) in &tag.attributes {
                let [name, value] = [&name[..], &value[..]].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
                if name == "id" || name == "name" && &tag.name[..] == b"a" {
                    page.sections.insert(value);
                } else if LINKS.contains(&name.as_str()) {
                    page.links.push(Link { target: value, is_followed: &tag.name[..] == b"a" });
                } else if name == "content" && value == POLICY {
                    page.has_policy = true;
                }
            }
        }
        page
    }
}

impl Link {
    fn check(&self, from: &Path, pages: &BTreeMap<PathBuf, Page>) -> Result {
        if is_foreign(&self.target) {
            return if self.is_followed { Ok(()) } else { Err("a browser asks another host for it".to_owned()) };
        }
        // What the link holds itself.
        if self.target.starts_with("data:") {
            return Ok(());
        }
        let (file, section) = self.target.split_once('#').unwrap_or((&self.target, ""));
        let folder = from.parent().unwrap_or(from);
        let path = if file.is_empty() { from.to_owned() } else { normal(&folder.join(file)) };
        if !path.is_file() {
            return Err("there is no such file".to_owned());
        }
        match pages.get(&path) {
            _ if section.is_empty() => Ok(()),
            Some(page) if page.sections.contains(section) => Ok(()),
            _ => Err("there is no such section".to_owned()),
        }
    }
}

/// Whether a link leads out of the site, to an address with a scheme or a host. What the link holds itself (`data:`) does not.
fn is_foreign(target: &str) -> bool {
    let scheme = target.split_once(':').map(|(scheme, _)| scheme);
    target.starts_with("//") || scheme.is_some_and(|scheme| scheme != "data" && !scheme.contains(['/', '#']))
}

/// What a style sheet asks other hosts for.
fn foreign_urls(css: &str) -> impl Iterator<Item = &str> {
    let urls = css.split("url(").skip(1).filter_map(|rest| rest.split(')').next());
    let imports = css.split("@import").skip(1).filter_map(|rest| rest.split(';').next());
    urls.chain(imports).map(|url| url.trim_matches([' ', '"', '\''])).filter(|url| is_foreign(url))
}

/// A path without `.` and `..`.
fn normal(path: &Path) -> PathBuf {
    let mut parts = PathBuf::new();
    for part in path.components() {
        match part {
            std::path::Component::ParentDir => drop(parts.pop()),
            std::path::Component::CurDir => {}
            part => parts.push(part),
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::{POLICY, check};

    /// What is wrong with a site of a page with this body, one with the section `there`, and a style sheet.
    fn checked(body: &str, css: &str) -> Result<usize, String> {
        let site = crate::run::target_folder().join(format!("site-test-{:?}", std::thread::current().id()));
        crate::run::remove(&site).unwrap();
        fs::create_dir_all(site.join("more")).unwrap();
        let head = format!("<meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\"><link href=\"a.css\">");
        fs::write(site.join("a.html"), format!("{head}{body}")).unwrap();
        fs::write(site.join("more/b.html"), head.replace("a.css", "../a.css") + "<h2 id=\"there\">").unwrap();
        fs::write(site.join("a.css"), css).unwrap();
        let result = check(&site);
        crate::run::remove(&site).unwrap();
        result
    }

    #[test]
    fn links_to_pages_sections_and_other_hosts_pass() {
        let body =
            "<a href=\"more/b.html#there\">b</a> <a href=\"https://docs.rs/x\">x</a> <a id=\"c\" href=\"#c\">c</a>
            <img src=\"data:image/png;base64,AAAA\"> <code>&lt;img src=\"https://x/y.png\"&gt;</code>
            <script>const text = '<img src=\"https://x/y.png\">';</script>";
        assert_eq!(checked(body, "a { background: url(data:image/png;base64,AAAA) }"), Ok(2));
    }

    #[test]
    fn what_leads_nowhere_is_refused_by_name() {
        for (link, what) in [
            ("more/c.html", "no such file"),
            ("b.html", "no such file"),
            ("more/b.html#gone", "no such section"),
            ("#gone", "no such section"),
            ("a.css#gone", "no such section"),
        ] {
            let error = checked(&format!("<a href=\"{link}\">"), "").unwrap_err();
            assert!(error.contains(&format!("a.html links to {link}: there is {what}")), "{error}");
        }
    }

    #[test]
    fn a_request_to_another_host_is_refused() {
        for url in ["https://x/y", "//x/y"] {
            for body in
                [format!("<img src=\"{url}\">"), format!("<link href='{url}'>"), format!("<script src={url}></script>")]
            {
                let error = checked(&body, "").unwrap_err();
                assert!(error.contains(url) && error.contains("another host"), "{error}");
            }
            for css in [
                format!("@font-face {{ src: url(\"{url}\") }}"),
                format!("@import '{url}';"),
                format!("@import url({url});"),
            ] {
                let error = checked("", &css).unwrap_err();
                assert!(error.contains("a.css asks another host"), "{error}");
            }
        }
    }
}
