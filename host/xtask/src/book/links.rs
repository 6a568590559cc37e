//! Follows the links within a folder of web pages.
//!
//! Pages are read as far as this needs: tags with their attributes. The contents of scripts and styles are left out. Links to the web are not followed.

use std::collections::{HashMap, HashSet};
use std::fmt;
use std::path::{Component, Path, PathBuf};

use anyhow::Result;

use crate::tidy;

/// The page that a server shows in place of a missing one: its links are meant for whatever folder that was in.
const MISSING: &str = "404.html";

/// What a check has found.
#[derive(Debug, Default)]
pub struct Checked {
    pub pages: usize,
    pub links: usize,
    pub broken: Vec<Broken>,
}

/// A link that leads nowhere.
#[derive(Debug, PartialEq, Eq)]
pub struct Broken {
    page: PathBuf,
    target: String,
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}: the link to `{}` leads nowhere",
            self.page.display(),
            self.target
        )
    }
}

/// A page's links, and the places on it that links may name.
#[derive(Debug, Default, PartialEq, Eq)]
struct Page {
    links: Vec<String>,
    places: HashSet<String>,
}

/// Follows every link of the pages below `folder`.
///
/// # Errors
/// When a file cannot be read.
pub fn check(folder: &Path) -> Result<Checked> {
    let files: HashSet<PathBuf> = tidy::files(folder)?.into_iter().collect();
    let mut pages = HashMap::new();
    for file in &files {
        if file.extension().is_some_and(|end| end == "html") && !file.ends_with(MISSING) {
            pages.insert(file.clone(), read(&std::fs::read_to_string(folder.join(file))?));
        }
    }
    let mut checked = Checked {
        pages: pages.len(),
        ..Checked::default()
    };
    for (file, page) in &pages {
        for target in page.links.iter().filter(|target| is_within(target)) {
            checked.links += 1;
            if !leads_somewhere(file, target, &files, &pages) {
                checked.broken.push(Broken {
                    page: file.clone(),
                    target: target.clone(),
                });
            }
        }
    }
    checked
        .broken
        .sort_by(|a, b| (&a.page, &a.target).cmp(&(&b.page, &b.target)));
    Ok(checked)
}

/// Whether a link leads to a file of this folder, and not to the web.
fn is_within(target: &str) -> bool {
    let scheme = target.split_once(':').map(|(scheme, _)| scheme);
    !target.starts_with("//") && scheme.is_none_or(|scheme| scheme.contains(['/', '#', '?']))
}

fn leads_somewhere(
    from: &Path,
    target: &str,
    files: &HashSet<PathBuf>,
    pages: &HashMap<PathBuf, Page>,
) -> bool {
    let (path, place) = target.split_once('#').unwrap_or((target, ""));
    let path = path.split('?').next().unwrap_or_default();
    let file = if path.is_empty() {
        Some(from.to_path_buf())
    } else {
        beside(from, path)
    };
    let Some(file) = file else {
        return false;
    };
    let is_place = |page: &Page| place.is_empty() || page.places.contains(place);
    files.contains(&file) && pages.get(&file).is_none_or(is_place)
}

/// The file at a relative path from a page; `None` where that leads out of the folder.
fn beside(page: &Path, path: &str) -> Option<PathBuf> {
    let mut file = page.parent()?.to_path_buf();
    for part in Path::new(path).components() {
        match part {
            Component::Normal(name) => file.push(name),
            Component::ParentDir => file.pop().then_some(())?,
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(file)
}

/// Reads the tags of a page.
fn read(html: &str) -> Page {
    let mut page = Page::default();
    let mut rest = html;
    while let Some((_, after)) = rest.split_once('<') {
        if let Some(comment) = after.strip_prefix("!--") {
            rest = comment.split_once("-->").map_or("", |(_, after)| after);
            continue;
        }
        let (tag, after) = split_tag(after);
        let name = tag
            .split(|letter: char| letter.is_whitespace() || letter == '/')
            .next()
            .unwrap_or_default();
        for (key, value) in attributes(&tag[name.len()..]) {
            match key {
                "href" | "src" => page.links.push(plain(value)),
                "id" | "name" => drop(page.places.insert(plain(value))),
                _ => {}
            }
        }
        rest = if matches!(name, "script" | "style") {
            let end = format!("</{name}");
            after.split_once(end.as_str()).map_or("", |(_, after)| after)
        } else {
            after
        };
    }
    page
}

/// A tag's inside, and what follows it; `>` in quotes is part of it.
fn split_tag(text: &str) -> (&str, &str) {
    let mut quote = None;
    for (at, letter) in text.char_indices() {
        match (quote, letter) {
            (None, '>') => return (&text[..at], &text[at + 1..]),
            (None, '"' | '\'') => quote = Some(letter),
            (Some(open), _) if open == letter => quote = None,
            _ => {}
        }
    }
    (text, "")
}

/// Keys and values `key="value"` of a tag.
fn attributes(tag: &str) -> Vec<(&str, &str)> {
    let mut found = Vec::new();
    let mut rest = tag;
    while let Some((before, after)) = rest.split_once('=') {
        let key = before
            .rsplit(|letter: char| letter.is_whitespace() || "\"'".contains(letter))
            .next();
        let value = ['"', '\''].iter().find_map(|quote| {
            let inner = after.strip_prefix(*quote)?;
            inner.split_once(*quote)
        });
        let (value, after) = value.unwrap_or(("", after));
        found.extend(key.map(|key| (key, value)));
        rest = after;
    }
    found
}

/// A value without the marks that stand for letters: `&amp;`, and `%20` and the like of other bytes.
fn plain(value: &str) -> String {
    let value = value
        .replace("&amp;", "&")
        .replace("&quot;", "\"")
        .replace("&#39;", "'");
    let mut bytes = Vec::with_capacity(value.len());
    let mut rest = value.as_bytes();
    while let [first, after @ ..] = rest {
        let code = after.get(..2).filter(|_| *first == b'%');
        let code = code.and_then(|code| u8::from_str_radix(std::str::from_utf8(code).ok()?, 16).ok());
        bytes.push(code.unwrap_or(*first));
        rest = if code.is_some() { &after[2..] } else { after };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_are_read_and_scripts_and_text_are_not() {
        let html = "<!doctype html><a class=x href=\"b.html#%C2%B5\" title=\"a > b\">href=\"no\"</a><!-- <a href=\"no\"> -->\
            <script src='s.js'>if (a<b) { x = '<a href=\"no\">' }</script><img src=\"p.png\"/><h2 id='top'>T</h2><a name=\"a&amp;b\"></a>";
        let page = read(html);
        assert_eq!(page.links, ["b.html#µ", "s.js", "p.png"]);
        assert_eq!(page.places, HashSet::from(["top".to_owned(), "a&b".to_owned()]));
    }

    #[test]
    fn links_that_lead_nowhere_are_found() {
        let place = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let file = place.path().join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, text).unwrap();
        };
        write(
            "index.html",
            "<h1 id=\"top\"></h1><a href=\"#top\"><a href=\"docs/a.html#x\"><a href=\"https://example.org\"><a href=\"mailto:a@b\">\
             <img src=\"docs/p.png\"><a href=\"docs/a.html#y\"><a href=\"#bottom\"><a href=\"docs\"><a href=\"../out.html\"><a href=\"/index.html\">",
        );
        write(
            "docs/a.html",
            "<p id=\"x\"><a href=\"../index.html\"><a href=\"b.html\">",
        );
        write("docs/p.png", "");
        write("404.html", "<a href=\"nowhere\">");
        let checked = check(place.path()).unwrap();
        let broken: Vec<String> = checked.broken.iter().map(ToString::to_string).collect();
        let line = |page: &str, target: &str| format!("{page}: the link to `{target}` leads nowhere");
        assert_eq!(
            broken,
            [
                line("docs/a.html", "b.html"),
                line("index.html", "#bottom"),
                line("index.html", "../out.html"),
                line("index.html", "/index.html"),
                line("index.html", "docs"),
                line("index.html", "docs/a.html#y"),
            ]
        );
        assert_eq!((checked.pages, checked.links), (2, 10));
    }
}
