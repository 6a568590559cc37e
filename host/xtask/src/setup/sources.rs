//! Reads apt's lists of package sources, to add a backports suite from the mirror in use.
//!
//! Formats: one-line (`*.list`) and deb822 (`*.sources`), as in sources.list(5).

use anyhow::{Result, bail};

/// One enabled source of binary packages.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Source {
    /// Mirror, as written.
    pub uri: String,
    /// Suites, such as `bookworm` and `bookworm-updates`.
    pub suites: Vec<String>,
    /// Components, such as `main`.
    pub components: Vec<String>,
    /// Options in one-line form, such as `signed-by=/usr/share/keyrings/x.gpg`.
    pub options: Vec<String>,
    /// True if the signing key is inline in the file, which the one-line form cannot express.
    pub key_inline: bool,
}

/// Sources in a `*.list` file.
pub fn parse_list(text: &str) -> Vec<Source> {
    text.lines().filter_map(parse_list_line).collect()
}

fn parse_list_line(line: &str) -> Option<Source> {
    let line = line.split('#').next().unwrap_or_default().trim();
    let rest = line
        .strip_prefix("deb")
        .filter(|rest| rest.starts_with([' ', '\t', '[']))?
        .trim_start();
    let (options, rest) = match rest.strip_prefix('[') {
        Some(inner) => inner.split_once(']')?,
        None => ("", rest),
    };
    let mut words = rest.split_whitespace().map(str::to_owned);
    Some(Source {
        uri: words.next()?,
        suites: vec![words.next()?],
        components: words.collect(),
        options: options.split_whitespace().map(str::to_owned).collect(),
        key_inline: false,
    })
}

/// Sources in a `*.sources` file.
pub fn parse_deb822(text: &str) -> Vec<Source> {
    let mut found = Vec::new();
    let mut fields: Vec<(String, String)> = Vec::new();
    for line in text.lines().chain(std::iter::once("")) {
        if line.trim().is_empty() {
            found.extend(sources_of(&std::mem::take(&mut fields)));
        } else if line.starts_with('#') {
            // A comment may stand between the lines of a field.
        } else if line.starts_with([' ', '\t']) {
            if let Some((_, value)) = fields.last_mut() {
                value.push('\n');
                value.push_str(line.trim());
            }
        } else if let Some((name, value)) = line.split_once(':') {
            fields.push((name.trim().to_lowercase(), value.trim().to_owned()));
        }
    }
    found
}

fn sources_of(fields: &[(String, String)]) -> Vec<Source> {
    let words = |name: &str| -> Vec<String> {
        let value = fields
            .iter()
            .find(|(field, _)| field == name)
            .map_or("", |(_, value)| value);
        value.split_whitespace().map(str::to_owned).collect()
    };
    let enabled = words("enabled")
        .first()
        .is_none_or(|value| value != "no" && value != "false");
    if !enabled || !words("types").iter().any(|kind| kind == "deb") {
        return Vec::new();
    }
    let mut options = Vec::new();
    let mut key_inline = false;
    for field in ["architectures", "signed-by", "trusted", "check-valid-until"] {
        let value = words(field).join(",");
        if field == "signed-by" && value.contains("BEGIN") {
            key_inline = true;
        } else if !value.is_empty() {
            let option = if field == "architectures" { "arch" } else { field };
            options.push(format!("{option}={value}"));
        }
    }
    words("uris")
        .into_iter()
        .map(|uri| Source {
            uri,
            suites: words("suites"),
            components: words("components"),
            options: options.clone(),
            key_inline,
        })
        .collect()
}

/// How to obtain the backports suite.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Backports {
    /// A source in use already has it.
    Present,
    /// This line for a `*.list` file adds it.
    Add(String),
}

/// Determines how to obtain `codename`'s backports from the mirror that already serves `codename`.
///
/// # Errors
/// When no source serves `codename`, or its key cannot be given in the one-line form.
pub fn backports(sources: &[Source], codename: &str) -> Result<Backports> {
    let suite = format!("{codename}-backports");
    if sources.iter().any(|source| source.suites.contains(&suite)) {
        return Ok(Backports::Present);
    }
    let Some(base) = sources.iter().find(|source| {
        source.suites.iter().any(|suite| suite == codename)
            && source.components.iter().any(|component| component == "main")
            && !source.uri.starts_with("cdrom:")
    }) else {
        bail!(
            "no package source in /etc/apt serves `{codename}`, so there is no mirror to take `{suite}` from"
        );
    };
    if base.key_inline {
        bail!("the source of `{codename}` carries its key in the file: add `{suite}` to its Suites by hand");
    }
    let options = if base.options.is_empty() {
        String::new()
    } else {
        format!("[{}] ", base.options.join(" "))
    };
    Ok(Backports::Add(format!(
        "deb {options}{} {suite} {}",
        base.uri,
        base.components.join(" ")
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEB822: &str = "\
Types: deb
# http://snapshot.debian.org/archive/debian/20250520T000000Z
URIs: http://mirror.example/debian
Suites: bookworm bookworm-updates
Components: main
Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg

Types: deb
URIs: http://mirror.example/debian-security
Suites: bookworm-security
Components: main
";

    #[test]
    fn deb822_keeps_mirror_scheme_and_key() {
        let sources = parse_deb822(DEB822);
        assert_eq!(sources.len(), 2);
        assert_eq!(
            backports(&sources, "bookworm").unwrap(),
            Backports::Add(
                "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] \
                 http://mirror.example/debian bookworm-backports main"
                    .into()
            )
        );
    }

    #[test]
    fn one_line_form_keeps_options_and_components() {
        let text = "# comment\n\
            deb-src https://a.example/debian bookworm main\n\
            deb [ arch=amd64 check-valid-until=no ] https://a.example/debian/ bookworm main contrib # trailing\n\
            deb http://security.example/ bookworm-security main\n";
        assert_eq!(
            backports(&parse_list(text), "bookworm").unwrap(),
            Backports::Add(
                "deb [arch=amd64 check-valid-until=no] https://a.example/debian/ bookworm-backports main contrib".into()
            )
        );
    }

    #[test]
    fn a_suite_in_use_is_not_added_again() {
        let text =
            "deb http://a.example/ubuntu noble main\ndeb http://a.example/ubuntu noble-backports main\n";
        assert_eq!(backports(&parse_list(text), "noble").unwrap(), Backports::Present);
    }

    #[test]
    fn what_cannot_be_extended_is_refused_with_the_reason() {
        let disabled = DEB822.replace("Types: deb\nURIs", "Enabled: no\nTypes: deb\nURIs");
        assert_eq!(parse_deb822(&disabled).len(), 1);
        let error = backports(&parse_deb822(&disabled), "trixie")
            .unwrap_err()
            .to_string();
        assert!(error.contains("`trixie`"), "{error}");

        let inline = "Types: deb\nURIs: http://a.example/debian\nSuites: trixie\nComponents: main\nSigned-By:\n \
                      -----BEGIN PGP PUBLIC KEY BLOCK-----\n .\n abc\n";
        assert!(
            backports(&parse_deb822(inline), "trixie")
                .unwrap_err()
                .to_string()
                .contains("by hand")
        );
        assert!(backports(&parse_list("deb cdrom:[Debian]/ trixie main"), "trixie").is_err());
        assert!(backports(&[], "trixie").is_err());
    }

    #[test]
    fn several_uris_make_several_sources() {
        let text = "Types: deb deb-src\nURIs: http://a.example/ http://b.example/\nSuites: trixie\nComponents: main\n";
        let sources = parse_deb822(text);
        assert_eq!(
            sources
                .iter()
                .map(|source| source.uri.as_str())
                .collect::<Vec<_>>(),
            ["http://a.example/", "http://b.example/"]
        );
    }
}
