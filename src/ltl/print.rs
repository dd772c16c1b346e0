//! Printing formulas in Spot's syntax.

use std::fmt;

use super::Formula;
use super::lexer::is_bare_name;

/// How tightly an operator binds; see the grammar in [`crate::ltl`].
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Tightness {
    Arrow,
    Or,
    And,
    Temporal,
    Unary,
    Atom,
}

impl Tightness {
    fn of(formula: &Formula) -> Self {
        match formula {
            Formula::True | Formula::False | Formula::Prop(_) => Self::Atom,
            Formula::Not(_) | Formula::Next(_) | Formula::Finally(_) | Formula::Globally(_) => {
                Self::Unary
            }
            Formula::And(..) => Self::And,
            Formula::Or(..) => Self::Or,
            Formula::Implies(..) | Formula::Iff(..) => Self::Arrow,
            Formula::Until(..)
            | Formula::Release(..)
            | Formula::WeakUntil(..)
            | Formula::StrongRelease(..) => Self::Temporal,
        }
    }
}

/// What is still to be printed. A list of these replaces recursion, so no depth overflows a stack.
enum Item<'f> {
    Text(&'static str),
    Node(&'f Formula),
}

fn operator(formula: &Formula) -> &'static str {
    match formula {
        Formula::Not(_) => "!",
        Formula::Next(_) => "X",
        Formula::Finally(_) => "F",
        Formula::Globally(_) => "G",
        Formula::And(..) => " & ",
        Formula::Or(..) => " | ",
        Formula::Implies(..) => " -> ",
        Formula::Iff(..) => " <-> ",
        Formula::Until(..) => " U ",
        Formula::Release(..) => " R ",
        Formula::WeakUntil(..) => " W ",
        Formula::StrongRelease(..) => " M ",
        Formula::True => "1",
        Formula::False => "0",
        Formula::Prop(_) => "",
    }
}

/// Whether `child` needs parentheses as the `right` (or only, or left) operand of `parent`.
fn parenthesised(parent: &Formula, child: &Formula, right: bool) -> bool {
    let (outer, inner) = (Tightness::of(parent), Tightness::of(child));
    match outer {
        // `F1` would be a proposition's name.
        Tightness::Unary => {
            inner < Tightness::Unary
                || !matches!(parent, Formula::Not(_))
                    && matches!(child, Formula::True | Formula::False)
        }
        Tightness::And | Tightness::Or => inner < outer || inner == outer && right,
        Tightness::Temporal => inner < outer || inner == outer && !right,
        // `->` and `<->` bind alike; parentheses keep a mixture readable.
        Tightness::Arrow | Tightness::Atom => {
            inner == outer
                && !(right && std::mem::discriminant(parent) == std::mem::discriminant(child))
        }
    }
}

fn push<'f>(todo: &mut Vec<Item<'f>>, child: &'f Formula, parentheses: bool) {
    if parentheses {
        todo.extend([Item::Text(")"), Item::Node(child), Item::Text("(")]);
    } else {
        todo.push(Item::Node(child));
    }
}

fn write_name(f: &mut fmt::Formatter<'_>, name: &str) -> fmt::Result {
    if is_bare_name(name) {
        return f.write_str(name);
    }
    f.write_str("\"")?;
    for c in name.chars() {
        if c == '"' || c == '\\' {
            f.write_str("\\")?;
        }
        write!(f, "{c}")?;
    }
    f.write_str("\"")
}

impl fmt::Display for Formula {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut todo = vec![Item::Node(self)];
        while let Some(item) = todo.pop() {
            let node = match item {
                Item::Text(text) => {
                    f.write_str(text)?;
                    continue;
                }
                Item::Node(node) => node,
            };
            let mut children = node.children();
            match (node, children.next(), children.next()) {
                (Formula::Prop(name), ..) => write_name(f, name)?,
                (_, Some(left), Some(right)) => {
                    push(&mut todo, right, parenthesised(node, right, true));
                    todo.push(Item::Text(operator(node)));
                    push(&mut todo, left, parenthesised(node, left, false));
                }
                (_, Some(only), None) => {
                    push(&mut todo, only, parenthesised(node, only, false));
                    todo.push(Item::Text(operator(node)));
                }
                _ => f.write_str(operator(node))?,
            }
        }
        Ok(())
    }
}
