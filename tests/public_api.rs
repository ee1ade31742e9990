//! The public items of the library crates are those of a stored listing, so that no change of them goes unseen.
//!
//! The listing is made from the sources. The lint `unreachable_pub`, which the gate treats as an error, keeps `pub` for
//! what users can reach. So a `pub` item is a public one, wherever its file is.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use syn::{Attribute, Fields, ImplItem, Item, Type, Visibility, parse_quote};

const CRATES: [&str; 3] = ["tldi", "tldi-sources", "rapier3d-tldi"];

/// Set, it makes the test write the listings anew.
const WRITE: &str = "TLDI_WRITE_PUBLIC_API";

fn top() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The sources of a folder and those below it.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display())) {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

/// Keeps what a caller depends on.
fn strip(attributes: &mut Vec<Attribute>) {
    let kept = [
        "cfg",
        "derive",
        "non_exhaustive",
        "must_use",
        "repr",
        "deprecated",
    ];
    attributes.retain(|attribute| kept.iter().any(|name| attribute.path().is_ident(name)));
}

/// Keeps public fields. Where there are others, it says so.
fn strip_fields(fields: &mut Fields) {
    let all = fields.len();
    let public: Vec<_> = (fields.iter().filter(|field| is_public(&field.vis)))
        .cloned()
        .map(|mut field| {
            strip(&mut field.attrs);
            field
        })
        .collect();
    let hidden = (public.len() < all).then_some(());
    match fields {
        Fields::Named(named) => {
            let hidden = hidden.map(|()| -> syn::Field { parse_quote!(private: ()) });
            named.named = public.into_iter().chain(hidden).collect();
        }
        Fields::Unnamed(unnamed) => {
            let hidden = hidden.map(|()| -> syn::Field { parse_quote!(()) });
            unnamed.unnamed = public.into_iter().chain(hidden).collect();
        }
        Fields::Unit => {}
    }
}

/// The public items of a crate, in pieces that do not depend on the files that they are in.
#[derive(Default)]
struct Listing {
    types: BTreeSet<String>,
    entries: BTreeSet<String>,
    impls: Vec<syn::ItemImpl>,
}

impl Listing {
    fn of(source: &Path) -> Self {
        let mut paths = Vec::new();
        sources(source, &mut paths);
        let mut listing = Self::default();
        for path in paths.iter().filter(|path| !path.ends_with("tests.rs")) {
            let text =
                fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            let file = syn::parse_file(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            file.items.into_iter().for_each(|item| listing.add(item));
        }
        for implementation in std::mem::take(&mut listing.impls) {
            listing.add_impl(implementation);
        }
        listing
    }

    fn push(&mut self, item: Item) {
        let file = syn::File {
            shebang: None,
            attrs: Vec::new(),
            items: vec![item],
        };
        self.entries.insert(prettyplease::unparse(&file));
    }

    fn add(&mut self, mut item: Item) {
        match &mut item {
            Item::Const(c) if is_public(&c.vis) => strip(&mut c.attrs),
            Item::Static(s) if is_public(&s.vis) => strip(&mut s.attrs),
            Item::Type(t) if is_public(&t.vis) => strip(&mut t.attrs),
            Item::Use(u) if is_public(&u.vis) => strip(&mut u.attrs),
            Item::Fn(f) if is_public(&f.vis) => {
                strip(&mut f.attrs);
                f.block = parse_quote!({});
            }
            Item::Struct(s) if is_public(&s.vis) => {
                strip(&mut s.attrs);
                strip_fields(&mut s.fields);
                self.types.insert(s.ident.to_string());
            }
            Item::Enum(e) if is_public(&e.vis) => {
                strip(&mut e.attrs);
                for variant in &mut e.variants {
                    strip(&mut variant.attrs);
                    variant
                        .fields
                        .iter_mut()
                        .for_each(|field| strip(&mut field.attrs));
                }
                self.types.insert(e.ident.to_string());
            }
            Item::Trait(t) if is_public(&t.vis) => {
                strip(&mut t.attrs);
                for member in &mut t.items {
                    if let syn::TraitItem::Fn(f) = member {
                        strip(&mut f.attrs);
                        f.default = f.default.is_some().then(|| parse_quote!({}));
                    }
                }
            }
            Item::Impl(implementation) => {
                self.impls.push(implementation.clone());
                return;
            }
            Item::Mod(module) if is_public(&module.vis) => {
                strip(&mut module.attrs);
                module.content = None;
                module.semi = Some(Default::default());
            }
            // Flags, whose types a macro makes.
            Item::Macro(call)
                if call
                    .mac
                    .path
                    .segments
                    .last()
                    .is_some_and(|s| s.ident == "bitflags") =>
            {
                let tokens = call.mac.tokens.to_string();
                let mut parts = tokens.split("# [doc");
                let mut text = parts.next().unwrap_or_default().to_owned();
                // The rest of a doc ends with its closing quote and bracket.
                text.extend(parts.filter_map(|part| Some(part.split_once("\"]")?.1)));
                let words: Vec<&str> = text.split_whitespace().collect();
                let name = words.windows(2).find(|pair| pair[0] == "struct");
                self.types.extend(name.map(|pair| pair[1].to_owned()));
                self.entries
                    .insert(format!("bitflags! {{{}}}\n", words.join(" ")));
                return;
            }
            _ => return,
        }
        self.push(item);
    }

    /// Public functions and constants of a public type, one by one, and the traits that it implements.
    fn add_impl(&mut self, mut implementation: syn::ItemImpl) {
        let Type::Path(path) = &*implementation.self_ty else {
            return;
        };
        let name = path.path.segments.last().expect("a name").ident.to_string();
        if !self.types.contains(&name) {
            return;
        }
        strip(&mut implementation.attrs);
        let members = std::mem::take(&mut implementation.items);
        if implementation.trait_.is_some() {
            self.push(Item::Impl(implementation));
            return;
        }
        for mut member in members {
            match &mut member {
                ImplItem::Fn(f) if is_public(&f.vis) => {
                    strip(&mut f.attrs);
                    f.block = parse_quote!({});
                }
                ImplItem::Const(c) if is_public(&c.vis) => strip(&mut c.attrs),
                _ => continue,
            }
            let mut alone = implementation.clone();
            alone.items.push(member);
            self.push(Item::Impl(alone));
        }
    }

    fn text(&self) -> String {
        let entries: Vec<&str> = self.entries.iter().map(String::as_str).collect();
        entries.join("\n")
    }
}

#[test]
fn public_items_are_those_of_the_listing() {
    for name in CRATES {
        let made = Listing::of(&top().join("crates").join(name).join("src")).text();
        let path = top()
            .join("tests/results/public_api")
            .join(format!("{name}.txt"));
        if std::env::var_os(WRITE).is_some() {
            fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            fs::write(&path, &made).expect("the listing is written");
        }
        let stored =
            fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let entries = |text: &str| {
            text.split("\n\n")
                .map(str::trim)
                .map(str::to_owned)
                .collect::<BTreeSet<_>>()
        };
        let (made, stored) = (entries(&made), entries(&stored));
        let list = |of: Vec<&String>| of.into_iter().map(|e| format!("{e}\n")).collect::<String>();
        assert!(
            made == stored,
            "the public items of {name} changed.\n\nNew:\n{}\nGone:\n{}\nIf that is meant, run this test with {WRITE}=1, and \
             say it in CHANGELOG.md.",
            list(made.difference(&stored).collect()),
            list(stored.difference(&made).collect())
        );
    }
}

/// What is public of a source, and what is not.
#[test]
fn a_listing_holds_what_users_see() {
    let folder = std::env::temp_dir().join(format!("tldi_public_api_{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder for temporary files");
    let source = "
        /// Docs do not count.
        #[derive(Clone)]
        pub struct Seen { pub size: f32, hidden: u8 }
        struct Unseen;
        impl Seen {
            pub fn twice(&self) -> f32 { 2.0 * self.size }
            pub(crate) fn inner(&self) {}
        }
        impl Unseen { pub fn nothing() {} }
        impl Default for Seen { fn default() -> Self { Self { size: 1.0, hidden: 0 } } }
        pub(crate) fn helper() {}
        #[cfg(test)]
        mod tests { pub fn helper() {} }
    ";
    fs::write(folder.join("lib.rs"), source).expect("it is ours");
    let text = Listing::of(&folder).text();
    fs::remove_dir_all(&folder).expect("it is ours");
    for part in [
        "#[derive(Clone)]",
        "pub size: f32",
        "private: ()",
        "pub fn twice(&self) -> f32 {}",
        "impl Default for Seen {}",
    ] {
        assert!(text.contains(part), "{part} in\n{text}");
    }
    for part in [
        "Docs", "hidden", "Unseen", "nothing", "inner", "helper", "2.0",
    ] {
        assert!(!text.contains(part), "{part} in\n{text}");
    }
}
