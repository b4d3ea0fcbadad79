//! The modules of a crate: which file holds each, and which names each has from elsewhere.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::Sources;
use crate::tokens::{Token, tokens};

/// A path of names.
pub(crate) type Names = Vec<String>;

/// A module, inline or in a file of its own.
#[derive(Debug, Default)]
pub(crate) struct Module {
    pub(crate) file: PathBuf,
    pub(crate) children: BTreeSet<String>,
    /// What `use` brings in: a name and the path that it stands for, from this module.
    pub(crate) imports: BTreeMap<String, Names>,
    /// The modules all of whose names are brought in.
    pub(crate) globs: Vec<Names>,
    /// Every path that its code names, `use` included.
    pub(crate) named: Vec<Names>,
}

/// All modules by their paths below the root.
pub(crate) type Modules = BTreeMap<Names, Module>;

/// The modules that the root declares, to the bottom.
pub(crate) fn modules(sources: &Sources, root: &Path) -> Modules {
    let mut modules = Modules::new();
    let mut waiting = vec![(Names::new(), root.to_path_buf())];
    while let Some((name, file)) = waiting.pop() {
        let Some(text) = sources.get(&file) else { continue };
        let mut reader = Reader {
            tokens: tokens(text),
            at: 0,
            file: file.clone(),
            modules: &mut modules,
            declared: Vec::new(),
        };
        reader.module(name);
        for child in reader.declared {
            let below: PathBuf = child.iter().collect();
            let places = [below.with_extension("rs"), below.join("mod.rs")];
            if let Some(place) = places.into_iter().find(|place| sources.contains_key(place)) {
                waiting.push((child, place));
            }
        }
    }
    modules
}

struct Reader<'a> {
    tokens: Vec<Token>,
    at: usize,
    file: PathBuf,
    modules: &'a mut Modules,
    /// Modules in files of their own.
    declared: Vec<Names>,
}

impl Reader<'_> {
    /// Reads to the end of a module: the closing bracket, or the end of the file.
    fn module(&mut self, name: Names) {
        let mut module = Module { file: self.file.clone(), ..Module::default() };
        let mut depth = 0usize;
        while let Some(token) = self.tokens.get(self.at).cloned() {
            self.at += 1;
            match token {
                Token::Sign('{') => depth += 1,
                Token::Sign('}') if depth == 0 => break,
                Token::Sign('}') => depth -= 1,
                Token::Word(word) if word == "use" => self.tree(&mut module, Names::new()),
                Token::Word(word) if word == "mod" => self.declaration(&mut module, &name),
                Token::Word(word) => {
                    // what follows a dot is a field or a method
                    let is_path = self.at < 2 || self.tokens[self.at - 2] != Token::Sign('.');
                    let path = self.path(word);
                    // a single name is a local one, or was brought in
                    if is_path && path.len() > 1 {
                        module.named.push(path);
                    }
                }
                _ => {}
            }
        }
        self.modules.insert(name, module);
    }

    fn declaration(&mut self, module: &mut Module, parent: &Names) {
        let Some(Token::Word(word)) = self.tokens.get(self.at).cloned() else { return };
        let child: Names = parent.iter().chain([&word]).cloned().collect();
        let next = self.tokens.get(self.at + 1).cloned();
        self.at += 2;
        module.children.insert(word);
        match next {
            Some(Token::Sign('{')) => self.module(child),
            _ => self.declared.push(child),
        }
    }

    /// The path that begins with `first`.
    fn path(&mut self, first: String) -> Names {
        let mut path = vec![first];
        while let (Some(Token::Path), Some(Token::Word(word))) =
            (self.tokens.get(self.at), self.tokens.get(self.at + 1))
        {
            path.push(word.clone());
            self.at += 2;
        }
        path
    }

    /// What a `use` names, `before` standing before it.
    fn tree(&mut self, module: &mut Module, before: Names) {
        let mut path = before;
        while let Some(token) = self.tokens.get(self.at).cloned() {
            match token {
                Token::Word(word) if word == "as" => {
                    if let Some(Token::Word(alias)) = self.tokens.get(self.at + 1).cloned() {
                        module.imports.insert(alias, path.clone());
                        module.named.push(std::mem::take(&mut path));
                    }
                    self.at += 2;
                }
                Token::Word(word) => {
                    path.push(word);
                    self.at += 1;
                }
                Token::Path => self.at += 1,
                Token::Sign('*') => {
                    module.globs.push(std::mem::take(&mut path));
                    self.at += 1;
                }
                Token::Sign('{') => {
                    self.at += 1;
                    while !matches!(self.tokens.get(self.at), None | Some(Token::Sign('}'))) {
                        self.tree(module, path.clone());
                        if self.tokens.get(self.at) == Some(&Token::Sign(',')) {
                            self.at += 1;
                        }
                    }
                    self.at += 1;
                    path.clear();
                }
                // the end, or that of this branch
                _ => break,
            }
        }
        if path.last().is_some_and(|name| name == "self") {
            path.pop();
        }
        if let Some(name) = path.last().cloned() {
            module.imports.insert(name, path.clone());
            module.named.push(path);
        }
    }
}
