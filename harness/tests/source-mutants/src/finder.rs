//! Finds what can be changed in a file.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use syn::parse::{Parse, Parser};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{
    Arm, BinOp, Block, Expr, ExprBinary, ExprIf, ExprLit, ExprMatch, ExprMethodCall, Lit, Pat,
    ReturnType, Signature, Stmt, Type, UnOp,
};

use crate::decisions::{Decisions, asks, is_decision};
use crate::operators::{self, Set};
use crate::results::results;
use crate::sites::{Site, alternative};
use crate::syntax::{Matches, binds, is_assignment};

/// A change of the source.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Mutant {
    /// By which it is switched on.
    pub id: usize,
    /// The file in the workspace.
    pub file: String,
    /// Counted from 1.
    pub line: usize,
    /// The function it is in, with its type.
    pub function: String,
    /// What stood there, and what stands there now.
    pub change: String,
    /// Whether an answer of the rules that never changes leads there, or leads past it.
    pub decided: bool,
    /// By whose rule it was made.
    pub set: Set,
    /// Whether the copy contains it.
    pub built: bool,
}

impl Mutant {
    /// File and function.
    pub fn place(&self) -> (&str, &str) {
        (&self.file, &self.function)
    }

    /// By what it is known when the source around it has changed.
    pub fn key(&self) -> Key {
        (self.file.clone(), self.function.clone(), self.change.clone())
    }
}

/// File, function and change.
pub type Key = (String, String, String);

/// What the compiler made of earlier attempts.
#[derive(Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Refused {
    /// Mutants that do not compile.
    pub mutants: BTreeSet<Key>,
    /// Functions that constants call; no switch can be in them.
    pub constant: BTreeSet<String>,
}

/// What stands at a place instead.
type Other = (Set, String);

fn further(text: impl Into<String>) -> Other {
    (Set::Further, text.into())
}

/// The changes of one file.
pub struct Finder<'a> {
    file: &'a str,
    text: &'a str,
    refused: &'a Refused,
    /// The number of the next mutant.
    next: &'a mut usize,
    /// Type and functions around the place.
    around: Vec<String>,
    /// Functions of types are deviations, and default functions alone are the device.
    defaults_only: bool,
    /// Decisions of the rules that depend on nothing.
    constant: &'a BTreeSet<String>,
    /// In how many branches that an unchanging answer of the rules has chosen the place is.
    decided: usize,
    /// In how many constructors and default values the place is, which cargo-mutants leaves alone.
    constructed: usize,
    /// What goes into the copy.
    wanted: &'a dyn Fn(&Mutant) -> bool,
    /// How often there was such a change in such a function.
    alike: BTreeMap<(String, String), usize>,
    /// What was found.
    pub mutants: Vec<Mutant>,
    /// Where to write it.
    pub sites: Vec<Site>,
}

/// What is done with the text around an alternative.
#[derive(Clone, Copy)]
enum Form {
    Expression,
    Statement,
    /// Of an arm, which may have no comma after it.
    Body,
}

impl<'a> Finder<'a> {
    /// Reads a file.
    pub fn new(
        file: &'a str,
        text: &'a str,
        refused: &'a Refused,
        constant: &'a BTreeSet<String>,
        wanted: &'a dyn Fn(&Mutant) -> bool,
        next: &'a mut usize,
    ) -> Self {
        Self {
            constant,
            wanted,
            constructed: 0,
            file,
            text,
            refused,
            next,
            around: Vec::new(),
            defaults_only: false,
            decided: 0,
            alike: BTreeMap::new(),
            mutants: Vec::new(),
            sites: Vec::new(),
        }
    }

    /// Finds everything in the file.
    pub fn read(&mut self, file: &syn::File, defaults_only: bool) {
        self.defaults_only = defaults_only;
        self.visit_file(file);
    }

    /// Gives a number to a change, if it compiles and goes into the copy.
    fn number(&mut self, set: Set, at: usize, from: &str, to: &str) -> Option<usize> {
        let id = *self.next;
        *self.next += 1;
        let function = self.around.join("::");
        let mut change = format!("`{}` → {}", short(from), shown(to));
        let alike = self.alike.entry((function.clone(), change.clone())).or_default();
        *alike += 1;
        if *alike > 1 {
            change += &format!(" ({alike})");
        }
        let mut mutant = Mutant {
            id,
            file: self.file.to_owned(),
            line: self.text[..at].matches('\n').count() + 1,
            function,
            change,
            decided: self.decided > 0,
            set: if self.constructed > 0 { Set::Further } else { set },
            built: false,
        };
        if self.refused.mutants.contains(&mutant.key()) {
            return None;
        }
        mutant.built = (self.wanted)(&mutant);
        let built = mutant.built.then_some(id);
        self.mutants.push(mutant);
        built
    }

    fn range(node: &impl Spanned) -> Range<usize> {
        node.span().byte_range()
    }

    fn source(&self, node: &impl Spanned) -> &'a str {
        &self.text[Self::range(node)]
    }

    fn wrap(&mut self, range: Range<usize>, form: Form, others: &[Other]) {
        let original = &self.text[range.clone()];
        let mut before = String::new();
        for (set, other) in others {
            if let Some(id) = self.number(*set, range.start, original, other) {
                let other = alternative(id, other);
                before += &format!("if {} {{ {other} }} else ", switch(id));
            }
        }
        if before.is_empty() {
            return;
        }
        let (open, close) = match form {
            Form::Expression => ("(", " })"),
            Form::Statement => ("", " }"),
            Form::Body => ("{ ", " } }"),
        };
        let before = format!("{open}{before}{{ ");
        self.sites.push(Site { range, before, after: close.into(), left_out: false });
    }

    fn replace(&mut self, node: &impl Spanned, others: &[Other]) {
        self.wrap(Self::range(node), Form::Expression, others);
    }

    fn binary(&mut self, binary: &ExprBinary) {
        if binds(&binary.left) || binds(&binary.right) {
            return;
        }
        let (left, right) = (self.source(&binary.left), self.source(&binary.right));
        let assigns = self.source(&binary.op).ends_with('=') && is_assignment(&binary.op);
        let mut others: Vec<_> = operators::binary(&binary.op)
            .map(|(set, op)| match assigns {
                true => (set, format!("{left} {op} {right}")),
                false => (set, format!("({left}) {op} ({right})")),
            })
            .collect();
        // Of an unsigned number and of bits, that is the same.
        if right == "0" && matches!(binary.op, BinOp::Ne(_)) {
            others.retain(|(_, other)| !other.ends_with(") > (0)"));
        }
        if operators::stands_alone(&binary.op) {
            // Without an answer that never changes, the device is the same.
            let kept = [(left, &binary.right), (right, &binary.left)];
            let kept =
                kept.into_iter().filter(|(_, forgotten)| !is_decision(forgotten, self.constant));
            others.extend(kept.map(|(kept, _)| further(kept)));
        }
        self.replace(binary, &others);
    }

    fn method_call(&mut self, call: &ExprMethodCall) {
        let name = call.method.to_string();
        let (receiver, whole) = (Self::range(&call.receiver), Self::range(call));
        let named = Self::range(&call.method);
        let mut others: Vec<_> = operators::method(&name)
            .iter()
            .map(|other| match *other {
                "!" => format!("!{}", &self.text[whole.clone()]),
                other => format!(
                    "{}{other}{}",
                    &self.text[whole.start..named.start],
                    &self.text[named.end..whole.end]
                ),
            })
            .map(further)
            .collect();
        if operators::can_be_left_out(&name) {
            others.push(further(&self.text[receiver]));
        }
        self.replace(call, &others);
    }

    fn number_literal(&mut self, literal: &ExprLit) {
        let others: Vec<_> = match &literal.lit {
            Lit::Int(int) => {
                let value: u128 = int.base10_parse().unwrap_or_default();
                let numbers = operators::numbers(value).into_iter();
                numbers.map(|number| further(format!("{number}{}", int.suffix()))).collect()
            }
            Lit::Bool(bool) => vec![further((!bool.value).to_string())],
            Lit::Float(float) => {
                let value: f64 = float.base10_parse().unwrap_or_default();
                let others = [value + 1.0, -value, 0.0].into_iter().filter(|other| *other != value);
                others.map(|other| further(format!("{other:?}"))).collect()
            }
            _ => return,
        };
        self.replace(literal, &others);
    }

    fn path(&mut self, path: &syn::ExprPath) {
        let text = self.source(path);
        let last = path.path.segments.last().map(|segment| segment.ident.to_string());
        let last = last.unwrap_or_default();
        if last.contains(|c: char| c.is_ascii_lowercase()) || last.len() < 2 {
            return;
        }
        let other = match text.rsplit_once("::") {
            Some(("Abort", _)) => "Abort::GENERAL".to_owned(),
            Some(("NmtState", "OPERATIONAL")) => "NmtState::PRE_OPERATIONAL".into(),
            Some(("NmtState", _)) => "NmtState::OPERATIONAL".into(),
            Some((owner, _)) if owner.ends_with("Duration") => return,
            _ => format!("({text} + 1)"),
        };
        if other != text {
            self.replace(path, &[further(other)]);
        }
    }

    fn call(&mut self, call: &syn::ExprCall) {
        let function = self.source(&*call.func);
        let other = match function {
            "Some" => "None".into(),
            "Err" => "Ok(Default::default())".into(),
            _ if function.ends_with("from_le_bytes") => {
                self.source(call).replacen("from_le_bytes", "from_be_bytes", 1)
            }
            _ => return,
        };
        self.replace(call, &[further(other)]);
    }

    fn condition(&mut self, branch: &ExprIf) {
        if matches!(*branch.cond, Expr::Call(_) | Expr::MethodCall(_) | Expr::Path(_))
            || matches!(*branch.cond, Expr::Field(_))
        {
            let other = format!("!({})", self.source(&*branch.cond));
            self.replace(&*branch.cond, &[further(other)]);
        }
    }

    /// What no device shows: the arguments of a decision that depends on nothing, and the number
    /// that stands for an object which is absent.
    fn has_idle_arguments(&self, call: &ExprMethodCall) -> bool {
        let fallback = matches!(call.args.first(), Some(Expr::Lit(_)))
            && matches!(call.method.to_string().as_str(), "unwrap_or" | "map_or");
        fallback || is_decision(&Expr::MethodCall(call.clone()), self.constant)
    }

    /// The condition, then the branches.
    fn branches(&mut self, branch: &ExprIf) {
        self.visit_expr(&branch.cond);
        let decided = usize::from(asks(&branch.cond, self.constant));
        self.decided += decided;
        self.visit_block(&branch.then_branch);
        if let Some((_, other)) = &branch.else_branch {
            self.visit_expr(other);
        }
        self.decided -= decided;
    }

    /// `matches!`: the answer negated, and each alternative left out.
    fn matches(&mut self, mac: &syn::ExprMacro) {
        if !mac.mac.path.is_ident("matches") {
            return;
        }
        let Ok(Matches { value, pattern, guard }) = mac.mac.parse_body() else { return };
        let (value, whole) = (self.source(&value), self.source(mac));
        let guard = guard.map(|guard| format!(" if {}", self.source(&guard)));
        let guard = guard.unwrap_or_default();
        let mut others = vec![further(format!("!{whole}"))];
        for other in self.without_one(&pattern) {
            others.push(further(format!("matches!({value}, {other}{guard})")));
        }
        self.replace(mac, &others);
    }

    /// The pattern without each of its alternatives, and ranges without their ends.
    fn without_one(&self, pattern: &Pat) -> Vec<String> {
        let Pat::Or(or) = pattern else {
            return self.shorter(pattern).into_iter().collect();
        };
        (0..or.cases.len())
            .map(|left_out| {
                let others = or.cases.iter().enumerate().filter(|(place, _)| *place != left_out);
                others.map(|(_, case)| self.source(case)).collect::<Vec<_>>().join(" | ")
            })
            .collect()
    }

    /// `a..=b` without b.
    fn shorter(&self, pattern: &Pat) -> Option<String> {
        let Pat::Range(range) = pattern else { return None };
        let (start, end) = (range.start.as_ref()?, range.end.as_ref()?);
        matches!(range.limits, syn::RangeLimits::Closed(_))
            .then(|| format!("{}..{}", self.source(start), self.source(end)))
    }

    fn arms(&mut self, expression: &ExprMatch) {
        let rest = expression.arms.last().filter(|arm| matches!(arm.pat, Pat::Wild(_)));
        let rest = rest.map(|arm| self.source(&*arm.body));
        for (place, arm) in expression.arms.iter().enumerate() {
            let next = expression.arms.get(place + 1);
            match rest {
                Some(_) if next.is_none() => {}
                Some(rest) => {
                    self.alternatives_removed(arm, rest);
                    self.arm_removed(Set::CargoMutants, arm);
                }
                None => {
                    if let Some(next) = next {
                        let (body, next) = (Self::range(&*arm.body), self.source(&*next.body));
                        self.wrap(body, Form::Body, &[further(next)]);
                    }
                    if arm.guard.is_some() {
                        self.arm_removed(Set::CargoMutants, arm);
                    }
                }
            }
        }
    }

    /// One of several alternatives of an arm goes where everything else goes.
    fn alternatives_removed(&mut self, arm: &Arm, rest: &str) {
        let removed: Vec<_> = match &arm.pat {
            Pat::Or(or) => or.cases.iter().map(|case| self.source(case).to_owned()).collect(),
            range @ Pat::Range(ends) if self.shorter(range).is_some() => {
                ends.end.iter().map(|end| self.source(end).to_owned()).collect()
            }
            _ => return,
        };
        let at = Self::range(&arm.pat).start;
        for case in removed {
            let (from, to) = (self.source(&arm.pat), format!("all but {case}"));
            if let Some(id) = self.number(Set::Further, at, from, &to) {
                let case = alternative(id, &format!("{case} if {} => {{ {rest} }}", switch(id)));
                self.sites.push(Site::insertion(at, format!("{case}\n")));
            }
        }
    }

    fn arm_removed(&mut self, set: Set, arm: &Arm) {
        let pattern = Self::range(&arm.pat);
        let Some((_, guard)) = &arm.guard else {
            if let Some(id) = self.number(set, pattern.start, self.source(&arm.pat), "") {
                let text = format!(" if !{}", switch(id));
                self.sites.push(Site::insertion(pattern.end, text));
            }
            return;
        };
        if binds(guard) {
            return;
        }
        let shown = &self.text[pattern.start..Self::range(&**guard).end];
        let removed = self.number(set, pattern.start, shown, "");
        let unguarded = self.number(set, pattern.start, shown, self.source(&arm.pat));
        let removed = removed.map(|id| format!("!{} && ", switch(id))).unwrap_or_default();
        let unguarded = unguarded.map(|id| format!("{} || ", switch(id))).unwrap_or_default();
        let before = format!("{removed}({unguarded}(");
        let range = Self::range(&**guard);
        self.sites.push(Site { range, before, after: "))".into(), left_out: false });
    }

    /// What the function does is left out.
    fn body(&mut self, signature: &Signature, block: &Block) {
        let at = Self::range(&block.brace_token.span.open()).end;
        let others = match &signature.output {
            _ if block.stmts.is_empty() => Vec::new(),
            ReturnType::Default => vec![(Set::CargoMutants, String::new())],
            ReturnType::Type(_, of) => results(of, &|node| self.source(node).to_owned()),
        };
        for (set, other) in others {
            let (from, to) = ("body", format!("return {other}"));
            let start = Self::range(&signature.ident).start;
            if let Some(id) = self.number(set, start, from, to.trim()) {
                let text = alternative(id, &format!("return {other};"));
                let text = format!(" if {} {{ {text} }} ", switch(id));
                self.sites.push(Site::insertion(at, text));
            }
        }
    }

    /// Goes into a function, unless no switch can be in it.
    fn function(&mut self, signature: &Signature, block: &Block) {
        let name = signature.ident.to_string();
        if let Some(constant) = &signature.constness {
            if self.refused.constant.contains(&name) {
                return;
            }
            let range = Self::range(constant);
            let (before, after) = (String::new(), String::new());
            self.sites.push(Site { range, before, after, left_out: true });
        }
        self.around.push(name);
        if self.file.ends_with("stack/node.rs") {
            let at = Self::range(&block.brace_token.span.open()).end;
            let text = " let _here = ::canopen::switch::OnDevice::begin(); ".to_owned();
            self.sites.push(Site::insertion(at, text));
        }
        let constructed = usize::from(self.around.last().is_some_and(|name| name == "new"));
        self.constructed += constructed;
        self.body(signature, block);
        self.visit_block(block);
        self.constructed -= constructed;
        self.around.pop();
    }

    /// A part of the decisions, as the macro of the rules takes it.
    fn decisions(&mut self, item: &syn::ItemMacro) {
        if !item.mac.path.is_ident("decisions") {
            return;
        }
        let Ok(decisions) = item.mac.parse_body::<Decisions>() else { return };
        self.around.push(decisions.name.to_string());
        decisions.methods.iter().for_each(|method| self.visit_trait_item_fn(method));
        self.around.pop();
    }

    fn statement(&mut self, statement: &Stmt) {
        let Stmt::Expr(expression, semicolon) = statement else { return };
        let removable = match expression {
            Expr::Assign(_)
            | Expr::MethodCall(_)
            | Expr::Call(_)
            | Expr::Return(_)
            | Expr::Continue(_)
            | Expr::Break(_)
            | Expr::Try(_) => semicolon.is_some(),
            Expr::Binary(binary) => is_assignment(&binary.op),
            Expr::If(branch) => branch.else_branch.is_none() && binds(&branch.cond),
            Expr::ForLoop(_) => true,
            _ => false,
        };
        if removable {
            self.wrap(Self::range(statement), Form::Statement, &[further("")]);
        }
    }
}

impl<'ast> Visit<'ast> for Finder<'_> {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        let attributes = match item {
            syn::Item::Mod(item) => &item.attrs,
            syn::Item::Fn(item) => &item.attrs,
            syn::Item::Impl(item) => &item.attrs,
            syn::Item::Trait(item) => &item.attrs,
            syn::Item::Macro(item) => return self.decisions(item),
            // Constants, types, imports.
            _ => return,
        };
        if !attributes.iter().any(|attribute| attribute.path().is_ident("cfg")) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        if self.defaults_only {
            return;
        }
        let of = item.trait_.as_ref().and_then(|(_, path, _)| path.segments.last());
        if of.is_some_and(|of| matches!(of.ident.to_string().as_str(), "Debug" | "Display")) {
            return;
        }
        self.around.push(self.source(&*item.self_ty).to_owned());
        let constructed = usize::from(of.is_some_and(|of| of.ident == "Default"));
        self.constructed += constructed;
        visit::visit_item_impl(self, item);
        self.constructed -= constructed;
        self.around.pop();
    }

    fn visit_item_trait(&mut self, item: &'ast syn::ItemTrait) {
        self.around.push(item.ident.to_string());
        visit::visit_item_trait(self, item);
        self.around.pop();
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        if !self.defaults_only {
            self.function(&item.sig, &item.block);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        if !item.attrs.iter().any(|attribute| attribute.path().is_ident("cfg")) {
            self.function(&item.sig, &item.block);
        }
    }

    fn visit_trait_item_fn(&mut self, item: &'ast syn::TraitItemFn) {
        if let Some(block) = &item.default {
            self.function(&item.sig, block);
        }
    }

    fn visit_stmt(&mut self, statement: &'ast Stmt) {
        self.statement(statement);
        visit::visit_stmt(self, statement);
    }

    fn visit_expr(&mut self, expression: &'ast Expr) {
        match expression {
            Expr::Binary(inner) => self.binary(inner),
            Expr::Unary(unary) if !matches!(unary.op, UnOp::Deref(_)) && !binds(&unary.expr) => {
                let other = self.source(&*unary.expr).to_owned();
                self.replace(unary, &[(Set::CargoMutants, other)]);
            }
            Expr::Lit(literal) => self.number_literal(literal),
            Expr::MethodCall(call) if self.has_idle_arguments(call) => {
                self.method_call(call);
                let used = usize::from(call.method == "map_or");
                self.visit_expr(&call.receiver);
                let rest = call.args.iter().skip(used).filter(|_| used > 0);
                return rest.for_each(|argument| self.visit_expr(argument));
            }
            Expr::If(branch) => {
                self.condition(branch);
                return self.branches(branch);
            }
            Expr::MethodCall(call) => self.method_call(call),
            Expr::Call(call) => self.call(call),
            Expr::Path(path) => self.path(path),
            Expr::Macro(mac) => self.matches(mac),
            Expr::Match(arms) => {
                let decided = usize::from(asks(&arms.expr, self.constant));
                self.decided += decided;
                self.arms(arms);
                visit::visit_expr(self, expression);
                self.decided -= decided;
                return;
            }
            Expr::ForLoop(loops) => {
                let decided = usize::from(asks(&loops.expr, self.constant));
                self.decided += decided;
                visit::visit_expr(self, expression);
                self.decided -= decided;
                return;
            }
            Expr::Cast(cast) => {
                if let Some(narrow) = operators::narrower(self.source(&*cast.ty)) {
                    let (inner, of) = (self.source(&*cast.expr), self.source(&*cast.ty));
                    self.replace(cast, &[further(format!("(({inner}) as {narrow}) as {of}"))]);
                }
            }
            _ => {}
        }
        visit::visit_expr(self, expression);
    }

    fn visit_expr_call(&mut self, call: &'ast syn::ExprCall) {
        // What is called is a path that nothing can be added to.
        call.args.iter().for_each(|argument| self.visit_expr(argument));
    }

    fn visit_expr_repeat(&mut self, repeat: &'ast syn::ExprRepeat) {
        self.visit_expr(&repeat.expr);
    }

    fn visit_expr_closure(&mut self, closure: &'ast syn::ExprClosure) {
        self.visit_expr(&closure.body);
    }

    fn visit_impl_item_const(&mut self, _: &'ast syn::ImplItemConst) {}

    fn visit_trait_item_const(&mut self, _: &'ast syn::TraitItemConst) {}

    fn visit_expr_const(&mut self, _: &'ast syn::ExprConst) {}

    fn visit_pat(&mut self, _: &'ast Pat) {}

    fn visit_type(&mut self, _: &'ast Type) {}

    fn visit_attribute(&mut self, _: &'ast syn::Attribute) {}

    fn visit_generic_argument(&mut self, _: &'ast syn::GenericArgument) {}
}

/// Reads a file of Rust.
pub fn parse(text: &str) -> syn::Result<syn::File> {
    syn::File::parse.parse_str(text)
}

fn switch(id: usize) -> String {
    format!("::canopen::switch::mutant({id})")
}

/// On one line, and not too long to be read.
fn short(text: &str) -> String {
    let mut words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if let Some((end, _)) = words.char_indices().nth(70) {
        words.truncate(end);
        words.push('…');
    }
    words
}

fn shown(text: &str) -> String {
    match text {
        "" => "removed".into(),
        text => format!("`{}`", short(text)),
    }
}
