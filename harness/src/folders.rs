//! The suite and register files to read: those of folders, or the copy in this program.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use canopen::catalogue::Catalogue;
use clap::Args;
use reports::Origin;
use runner::suite::{Library, built_in, fingerprint, is_register, is_suite};

use crate::data;
use crate::files::{read_folder, shown};
use crate::source::{Complaint, Place, Source};

/// Which suites are read.
#[derive(Clone, Debug, Default, Args)]
pub struct Folders {
    /// Folder with suites of your own, in addition to those in this program; may be repeated
    #[arg(long = "suites", value_name = "DIR")]
    pub more: Vec<PathBuf>,
    /// Folder with the only suites to read, instead of those in this program; may be repeated
    #[arg(long = "only-suites", value_name = "DIR")]
    pub only: Vec<PathBuf>,
    /// Which profiles.
    #[command(flatten)]
    pub catalogue: CatalogueFolder,
}

/// Which profiles are known.
#[derive(Clone, Debug, Default, Args)]
pub struct CatalogueFolder {
    /// Folder with files that override profiles of the catalogue in this program, such as its
    /// decisions about CiA 404, or add to them
    #[arg(long = "catalogue", value_name = "DIR")]
    pub folder: Option<PathBuf>,
}

impl CatalogueFolder {
    /// The profiles.
    ///
    /// # Errors
    /// Every complaint about the files of the folder.
    pub fn load(&self) -> Result<Arc<Catalogue>, Vec<Complaint>> {
        let built_in = Catalogue::built_in();
        let Some(folder) = &self.folder else { return Ok(Arc::clone(built_in)) };
        let mut found = Vec::new();
        read_folder(folder, &mut found).map_err(|complaint| vec![complaint])?;
        found.sort_by(|a, b| a.name.cmp(&b.name));
        let sources: Vec<_> = found.into_iter().map(Arc::new).collect();
        Ok(Arc::new(built_in.amended(&sources)?))
    }

    /// The option that names the folder again on a command line.
    pub fn option(&self) -> String {
        let folder =
            self.folder.as_ref().map(|folder| format!(" --catalogue {}", folder.display()));
        folder.unwrap_or_default()
    }
}

/// Files, and the names of those that are the user's.
pub(crate) type FilesAndOwn = (Vec<Arc<Source>>, BTreeSet<String>);

impl Folders {
    /// The options that name the same folders again on a command line.
    pub fn options(&self) -> String {
        let only = self.only.iter().map(|folder| format!(" --only-suites {}", folder.display()));
        let more = self.more.iter().map(|folder| format!(" --suites {}", folder.display()));
        only.chain(more).chain([self.catalogue.option()]).collect()
    }

    /// Loads the suites of these folders.
    ///
    /// # Errors
    /// Every complaint about every file.
    pub fn load(&self) -> Result<Library, Vec<Complaint>> {
        Library::from_sources(&self.sources()?, &self.catalogue.load()?)
    }

    /// Loads the suites that the patterns name, those that prove what these rely on, and those of
    /// the user, which are checked whenever they are read, and says whether these are not all. All
    /// are loaded where the names of files do not tell which suites a pattern names.
    ///
    /// # Errors
    /// Every complaint about these files.
    pub(crate) fn load_named(
        &self,
        patterns: &[String],
    ) -> Result<(Library, bool), Vec<Complaint>> {
        let (sources, own) = self.with_own()?;
        let catalogue = self.catalogue.load()?;
        let others = |source: &Arc<Source>| is_suite(source) && !own.contains(&source.name);
        let are_named = |pattern: &String| {
            sources.iter().any(|source| others(source) && may_name(pattern, source))
        };
        if patterns.is_empty() || !patterns.iter().all(are_named) {
            return Ok((Library::from_sources(&sources, &catalogue)?, false));
        }
        let asked = |source: &Arc<Source>| patterns.iter().any(|name| may_name(name, source));
        let (mut part, mut rest): (Vec<_>, Vec<_>) =
            sources.into_iter().partition(|source| !others(source) || asked(source));
        loop {
            let library = Library::from_part(&part, &catalogue)?;
            let relied = library.relied_on();
            let proves = |source: &Arc<Source>| relied.iter().any(|id| checks(source, id));
            let (proofs, others) = rest.into_iter().partition::<Vec<_>, _>(proves);
            if proofs.is_empty() {
                return Ok((library, true));
            }
            (part, rest) = ([part, proofs].concat(), others);
        }
    }

    /// Loads of these folders the wanted suites, with what they may share and the register.
    ///
    /// # Errors
    /// Every complaint about every file.
    pub(crate) fn load_part(
        &self,
        wanted: impl Fn(&Source) -> bool,
    ) -> Result<Library, Vec<Complaint>> {
        let mut sources = self.sources()?;
        sources.retain(|source| !is_suite(source) || wanted(source));
        Library::from_part(&sources, &self.catalogue.load()?)
    }

    /// The register files alone.
    ///
    /// # Errors
    /// When a folder cannot be read.
    pub(crate) fn register_sources(&self) -> Result<Vec<Arc<Source>>, Vec<Complaint>> {
        let mut sources = self.sources()?;
        sources.retain(is_register);
        Ok(sources)
    }

    /// The files by name, and which of them are the user's: those of the folders that are named, or
    /// else of `suites/` here, unless they are those in this program.
    ///
    /// # Errors
    /// Every complaint about the folders.
    pub(crate) fn with_own(&self) -> Result<FilesAndOwn, Vec<Complaint>> {
        let sources = self.sources()?;
        let own = self.own_of(sources.iter());
        Ok((sources, own))
    }

    /// Where the suites are from, and their fingerprint.
    ///
    /// # Errors
    /// Every complaint about the folders.
    pub(crate) fn origin(&self) -> Result<Origin, Vec<Complaint>> {
        let sources = self.gathered(false)?;
        let sha256 = fingerprint(sources.iter().map(|source| &**source));
        let here = data::folder().map(|folder| folder.join("suites"));
        let here = here.or_else(|| self.stands_alone(Path::new("suites")).then(|| "suites".into()));
        let base = match (self.only.is_empty(), here) {
            (true, Some(here)) => vec![shown(&here)],
            (true, None) => vec![data::BUILT_IN.to_owned()],
            (false, _) => self.only.iter().map(|folder| shown(folder)).collect(),
        };
        let more = self.more.iter().map(|folder| shown(folder));
        let from = base.into_iter().chain(more).collect::<Vec<_>>().join(" and ");
        Ok(Origin { from, sha256 })
    }

    /// Whether the suites of the working directory take the place of those in this program.
    fn stands_alone(&self, here: &Path) -> bool {
        self.more.is_empty() && here.join("requirements").is_dir()
    }

    /// Which of these files are the user's, by name: see [`with_own`](Self::with_own).
    pub(crate) fn own_of<'s>(
        &self,
        sources: impl Iterator<Item = &'s Arc<Source>>,
    ) -> BTreeSet<String> {
        let named: Vec<String> =
            self.only.iter().chain(&self.more).map(|folder| shown(folder)).collect();
        let built_in = built_in();
        let built_in = by_name(&built_in);
        let is_own = |source: &&Arc<Source>| match named.as_slice() {
            [] => built_in.get(&*source.name) != Some(&&*source.text),
            named => named.iter().any(|folder| Path::new(&source.name).starts_with(folder)),
        };
        sources.filter(is_own).map(|source| source.name.clone()).collect()
    }

    /// The files by name. Unless there are `only` folders, those of `HARNESS_DATA` are read, or
    /// else the copy in this program. A suite of a later folder replaces the one of the same name;
    /// what suites share is never replaced.
    /// `suites/` here takes the place of the copy when it has a register of its own and no folder
    /// is named.
    pub(crate) fn sources(&self) -> Result<Vec<Arc<Source>>, Vec<Complaint>> {
        self.gathered(true)
    }

    /// The same, where `noted` says whether a note tells of `suites/` here.
    fn gathered(&self, noted: bool) -> Result<Vec<Arc<Source>>, Vec<Complaint>> {
        let data = data::folder();
        let here = data.clone().unwrap_or_default().join("suites");
        let here = here.as_path();
        let stands_alone = self.stands_alone(here);
        let mut sources = BTreeMap::new();
        let mut folders = self.only.clone();
        match (self.only.is_empty(), data.is_some() || stands_alone) {
            (true, true) => folders.push(here.to_owned()),
            (true, false) => add(&mut sources, here, built_in()),
            (false, _) => {}
        }
        folders.extend(self.more.iter().cloned());
        let mut own: BTreeMap<String, Arc<Source>> = BTreeMap::new();
        for folder in folders {
            let mut found = Vec::new();
            read_folder(&folder, &mut found).map_err(|complaint| vec![complaint])?;
            let is_instead = noted && folder == here && data.is_none() && stands_alone;
            if is_instead && differ(&found, &built_in()) {
                complain!(
                    "note: the suites of ./suites are read instead of those in this program, from \
                     which they differ; a folder of your own that stands beside them has another \
                     name, with `--suites NAME`"
                );
            }
            let mut of_folder = BTreeMap::new();
            add(&mut of_folder, &folder, found);
            for (name, source) in of_folder {
                if folder != here {
                    let other = own.insert(name.clone(), Arc::clone(&source));
                    // Suites beside them rest on what they share.
                    let shared = sources.get(&name).filter(|_| is_shared(&name)).cloned();
                    let other = other.or(shared);
                    if let Some(other) = other.filter(|other| other.text != source.text) {
                        return Err(vec![same_name(&source, &other)]);
                    }
                }
                sources.insert(name, source);
            }
        }
        let mut sources: Vec<Arc<Source>> = sources.into_values().collect();
        sources.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(sources)
    }
}

/// Whether the pattern may be the name of this suite, of a folder around it or of a case in it. Of
/// a glob the part before its first wildcard tells.
fn may_name(pattern: &str, source: &Source) -> bool {
    let name = source.name.strip_prefix("suites/").unwrap_or(&source.name);
    let name = name.trim_end_matches(".yaml");
    if let Some(wildcard) = pattern.find(['*', '?']) {
        let fixed = &pattern[..wildcard];
        return name.starts_with(fixed)
            || fixed.strip_prefix(name).is_some_and(|rest| rest.starts_with('/'));
    }
    let below = |whole: &str, part: &str| {
        whole.strip_prefix(part).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    below(name, pattern.trim_end_matches('/')) || below(pattern, name)
}

/// Whether a case of the suite may check the requirement, as far as its text tells.
fn checks(source: &Source, id: &str) -> bool {
    source.text.match_indices(id).any(|(place, _)| {
        let before = &source.text[..place];
        before.rfind("checks:") > before.rfind("relies-on:")
    })
}

/// Whether it is a file that suites share.
fn is_shared(name: &str) -> bool {
    ["steps.yaml", "words.yaml"].iter().any(|shared| name.rsplit('/').next() == Some(shared))
}

/// Whether these are other files, or say something else.
fn differ(some: &[Source], others: &[Source]) -> bool {
    by_name(some) != by_name(others)
}

fn by_name(sources: &[Source]) -> BTreeMap<&str, &str> {
    sources.iter().map(|source| (&*source.name, &*source.text)).collect()
}

/// Of two files with the same name in their folders one would take the place of the other.
fn same_name(source: &Arc<Source>, other: &Source) -> Complaint {
    let message = format!(
        "{} has the same name in its folder: rename one, or put it into a subfolder",
        other.name
    );
    Complaint::at(source, Place::of_line(1), message)
}

/// Adds the files of a folder by their names within it.
fn add(sources: &mut BTreeMap<String, Arc<Source>>, folder: &Path, found: Vec<Source>) {
    let folder = shown(folder);
    for source in found {
        let name = source.name.strip_prefix(&folder).unwrap_or(&source.name);
        sources.insert(name.trim_start_matches('/').to_owned(), Arc::new(source));
    }
}
