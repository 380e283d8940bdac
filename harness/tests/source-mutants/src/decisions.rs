//! Decisions of the rules, and which of their answers never change.

use std::collections::BTreeSet;

use syn::parse::{Parse, ParseStream};
use syn::visit::{self, Visit};
use syn::{Expr, Pat, Token};

/// Whether this is an answer of the rules that never changes, perhaps negated.
pub fn is_decision(expression: &Expr, constant: &BTreeSet<String>) -> bool {
    match expression {
        Expr::Unary(unary) => is_decision(&unary.expr, constant),
        Expr::Paren(paren) => is_decision(&paren.expr, constant),
        Expr::MethodCall(call) => {
            let rules = match &*call.receiver {
                Expr::Path(path) => path.path.is_ident("rules"),
                Expr::Field(field) => {
                    matches!(&field.member, syn::Member::Named(name) if name == "rules")
                }
                _ => false,
            };
            rules && constant.contains(&call.method.to_string())
        }
        _ => false,
    }
}

/// Whether an expression has such an answer as a part.
pub fn asks(expression: &Expr, constant: &BTreeSet<String>) -> bool {
    struct Search<'a>(&'a BTreeSet<String>, bool);
    impl<'ast> Visit<'ast> for Search<'_> {
        fn visit_expr(&mut self, expression: &'ast Expr) {
            self.1 |= is_decision(expression, self.0);
            visit::visit_expr(self, expression);
        }
    }
    let mut search = Search(constant, false);
    search.visit_expr(expression);
    search.1
}

/// The decisions in a file of the rules that depend on nothing: their parameters have no use.
pub fn constant_decisions(file: &syn::File) -> Vec<String> {
    let macros = file.items.iter().filter_map(|item| match item {
        syn::Item::Macro(item) if item.mac.path.is_ident("decisions") => Some(item),
        _ => None,
    });
    let parts = macros.filter_map(|item| item.mac.parse_body::<Decisions>().ok());
    let methods = parts.flat_map(|decisions| decisions.methods);
    let unused = |input: &syn::FnArg| match input {
        syn::FnArg::Receiver(_) => true,
        syn::FnArg::Typed(typed) => {
            matches!(&*typed.pat, Pat::Ident(name) if name.ident.to_string().starts_with('_'))
        }
    };
    let constant = methods.filter(|method| method.sig.inputs.iter().all(unused));
    constant.map(|method| method.sig.ident.to_string()).collect()
}

/// `Name of Rules, otherwise [DEVIATIONS];` and methods.
pub struct Decisions {
    /// Of the part of the rules.
    pub name: syn::Ident,
    /// With what the documents say as their bodies.
    pub methods: Vec<syn::TraitItemFn>,
}

impl Parse for Decisions {
    fn parse(input: ParseStream<'_>) -> syn::Result<Self> {
        syn::Attribute::parse_outer(input)?;
        input.parse::<syn::Visibility>()?;
        let name = input.parse()?;
        input.parse::<syn::Ident>()?; // `of`
        input.parse::<syn::Path>()?;
        input.parse::<Token![,]>()?;
        input.parse::<syn::Ident>()?; // `otherwise`
        input.parse::<syn::ExprArray>()?;
        input.parse::<Token![;]>()?;
        let mut methods = Vec::new();
        while !input.is_empty() {
            methods.push(input.parse()?);
        }
        Ok(Self { name, methods })
    }
}
