//! From the text of a formula to an expression.
//!
//! ```text
//! sum     = product (('+' | '-') product)*
//! product = signed (('*' | '/') signed)*
//! signed  = ('+' | '-') signed | power
//! power   = atom ('**' signed)?
//! atom    = number | name | function '(' sum (',' sum)* ')' | '(' sum ')'
//! ```

use super::{Expression, Graph, Id, Node, Variable};
use crate::error::Error;

/// Longest text, and deepest nesting of brackets and signs.
const MAX_LENGTH: usize = 4000;
const MAX_DEPTH: usize = 60;

const FUNCTIONS: [(&str, usize); 6] =
    [("exp", 1), ("log", 1), ("sqrt", 1), ("step", 1), ("max", 2), ("min", 2)];
/// All that has a meaning of its own; any other name is a parameter.
const VARIABLES: &str = "I1, I2, J, I1bar, I2bar, I4, I6";

impl Expression {
    /// The energy that a formula gives, as in `mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2`.
    ///
    /// Names that are no variable (`I1 I2 J`, the isochoric `I1bar I2bar`, `I4 I6` of fibres) and no function are
    /// parameters, in the order in which they first appear.
    ///
    /// # Errors
    /// Text that is no formula, with the place in it.
    pub fn parse(text: &str) -> Result<Self, Error> {
        if text.len() > MAX_LENGTH {
            return Err(Error::input(format!(
                "the formula has {} characters; it may have {MAX_LENGTH}",
                text.len()
            )));
        }
        let graph = Graph::default();
        let mut parser = Parser { text, at: 0, depth: 0, graph, seen: 0, parameters: Vec::new() };
        let energy = parser.sum()?;
        parser.skip();
        if parser.at < text.len() {
            return Err(parser.refuse(match parser.peek() {
                Some('^') => "a power is written **".into(),
                Some(')') => "this bracket was never opened".into(),
                _ => "expected + - * / ** or the end".into(),
            }));
        }
        let Parser { graph, parameters, .. } = parser;
        Ok(Expression { graph, energy, parameters })
    }
}

struct Parser<'a> {
    text: &'a str,
    /// Byte that comes next.
    at: usize,
    depth: usize,
    graph: Graph,
    /// Nodes of which every number has a value.
    seen: usize,
    parameters: Vec<String>,
}

impl<'a> Parser<'a> {
    fn refuse(&self, what: String) -> Error {
        self.refuse_at(self.at, what)
    }

    /// An error with its place, counted in characters from 1, and the text up to it.
    fn refuse_at(&self, at: usize, what: String) -> Error {
        let (before, after) = self.text.split_at(at);
        let place = before.chars().count() + 1;
        let near: String = after.chars().take(12).collect();
        let near = if near.is_empty() { "the end".into() } else { format!("{near:?}") };
        Error::input(format!("formula, character {place}, at {near}: {what}"))
    }

    /// Refuses a constant that what was read from there on has made, and that no number holds.
    fn expect_values(&mut self, from: usize) -> Result<(), Error> {
        let new = &self.graph.nodes()[self.seen..];
        if new.iter().any(|node| matches!(node, Node::Number(x) if !x.is_finite())) {
            return Err(self.refuse_at(from, "a constant without a finite value".into()));
        }
        self.seen = self.graph.len();
        Ok(())
    }

    /// Where the next token begins.
    fn start(&mut self) -> usize {
        self.skip();
        self.at
    }

    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    fn skip(&mut self) {
        self.at += self.rest().len() - self.rest().trim_start().len();
    }

    /// Whether this comes next; then it is read.
    fn eat(&mut self, token: &str) -> bool {
        self.skip();
        let is_next = self.rest().starts_with(token);
        if is_next {
            self.at += token.len();
        }
        is_next
    }

    fn sum(&mut self) -> Result<Id, Error> {
        let start = self.start();
        let mut sum = self.product()?;
        loop {
            if self.eat("+") {
                let next = self.product()?;
                sum = self.graph.add(sum, next);
            } else if self.eat("-") {
                let next = self.product()?;
                sum = self.graph.sub(sum, next);
            } else {
                return Ok(sum);
            }
            self.expect_values(start)?;
        }
    }

    fn product(&mut self) -> Result<Id, Error> {
        let start = self.start();
        let mut product = self.signed()?;
        loop {
            if self.eat("*") {
                let next = self.signed()?;
                product = self.graph.mul(product, next);
            } else if self.eat("/") {
                let at = self.start();
                let next = self.signed()?;
                if self.graph.number_of(next) == Some(0.0) {
                    return Err(self.refuse_at(at, "division by zero".into()));
                }
                let inverse = self.graph.recip(next);
                product = self.graph.mul(product, inverse);
            } else {
                return Ok(product);
            }
            self.expect_values(start)?;
        }
    }

    fn signed(&mut self) -> Result<Id, Error> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(self.refuse(format!("more than {MAX_DEPTH} brackets in one another")));
        }
        let value = if self.eat("-") {
            let value = self.signed()?;
            self.graph.neg(value)
        } else if self.eat("+") {
            self.signed()?
        } else {
            self.power()?
        };
        self.depth -= 1;
        Ok(value)
    }

    fn power(&mut self) -> Result<Id, Error> {
        let start = self.start();
        let base = self.atom()?;
        if !self.eat("**") {
            return Ok(base);
        }
        let exponent = self.signed()?;
        let power = self.graph.power(base, exponent);
        self.expect_values(start)?;
        Ok(power)
    }

    fn atom(&mut self) -> Result<Id, Error> {
        if self.eat("(") {
            let value = self.sum()?;
            self.close()?;
            return Ok(value);
        }
        match self.peek() {
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() || c == '_' => self.name(),
            Some('^') => Err(self.refuse("a power is written **".into())),
            Some(_) => Err(self.refuse("expected a number, a name or a bracket".into())),
            None => Err(self.refuse("the formula ends where a value is missing".into())),
        }
    }

    fn close(&mut self) -> Result<(), Error> {
        if self.eat(")") {
            return Ok(());
        }
        Err(self.refuse("expected ) or + - * / **".into()))
    }

    fn number(&mut self) -> Result<Id, Error> {
        let bytes = self.rest().as_bytes();
        let digits =
            |from: usize| from + bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
        let mut end = digits(0);
        if bytes.get(end) == Some(&b'.') {
            end = digits(end + 1);
        }
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
            let last = digits((end + 1 + sign).min(bytes.len()));
            if last > end + 1 + sign {
                end = last;
            }
        }
        let word = &self.rest()[..end];
        let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
        let value = value.ok_or_else(|| self.refuse(format!("{word:?} is no number")))?;
        self.at += end;
        Ok(self.graph.number(value))
    }

    fn name(&mut self) -> Result<Id, Error> {
        let start = self.at;
        let is_of_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let word =
            &self.rest()[..self.rest().find(|c| !is_of_name(c)).unwrap_or(self.rest().len())];
        self.at += word.len();
        self.skip();
        let function = FUNCTIONS.iter().find(|(name, _)| *name == word);
        if self.rest().starts_with('(') {
            let Some(&(name, count)) = function else {
                let all = FUNCTIONS.map(|(name, _)| name).join(", ");
                return Err(
                    self.refuse_at(start, format!("{word} is no function; there are {all}"))
                );
            };
            return self.call(start, name, count);
        }
        if function.is_some() {
            return Err(self.refuse(format!("{word} is a function: expected (")));
        }
        Ok(match word {
            "I1" => self.graph.variable(Variable::I1),
            "I2" => self.graph.variable(Variable::I2),
            "J" => self.graph.variable(Variable::J),
            "I4" => self.graph.variable(Variable::I4),
            "I6" => self.graph.variable(Variable::I6),
            "I1bar" => self.isochoric(Variable::I1),
            "I2bar" => self.isochoric(Variable::I2),
            _ if is_like_a_variable(word) => {
                let what = format!("{word} is no variable; there are {VARIABLES}");
                return Err(self.refuse_at(start, what));
            }
            _ => {
                let known = self.parameters.iter().position(|name| name == word);
                let place = known.unwrap_or_else(|| {
                    self.parameters.push(word.to_string());
                    self.parameters.len() - 1
                });
                self.graph.parameter(place as u16)
            }
        })
    }

    /// `I1 J^(-2/3)`, `I2 J^(-4/3)`.
    fn isochoric(&mut self, variable: Variable) -> Id {
        let (j, exponent) = (self.graph.variable(Variable::J), self.graph.number(-2.0 / 3.0));
        let mut factor = self.graph.power(j, exponent);
        if variable == Variable::I2 {
            factor = self.graph.mul(factor, factor);
        }
        let invariant = self.graph.variable(variable);
        self.graph.mul(invariant, factor)
    }

    fn call(&mut self, start: usize, name: &str, count: usize) -> Result<Id, Error> {
        self.eat("(");
        let mut values = vec![self.sum()?];
        while self.eat(",") {
            values.push(self.sum()?);
        }
        self.close()?;
        if values.len() != count {
            let what = format!("{name} takes {count} value{}", if count == 1 { "" } else { "s" });
            return Err(self.refuse_at(start, what));
        }
        let graph = &mut self.graph;
        let value = match name {
            "exp" => graph.exp(values[0]),
            "log" => graph.ln(values[0]),
            "sqrt" => graph.sqrt(values[0]),
            "step" => graph.step(values[0]),
            _ => {
                // a + d step(d) with d = b - a, and a - d step(d) with d = a - b: where both are equal, the first counts.
                let (a, b) = (values[0], values[1]);
                let beyond = if name == "max" { graph.sub(b, a) } else { graph.sub(a, b) };
                let step = graph.step(beyond);
                let part = graph.mul(beyond, step);
                if name == "max" { graph.add(a, part) } else { graph.sub(a, part) }
            }
        };
        self.expect_values(start)?;
        Ok(value)
    }
}

/// Names that only a slip of the pen makes parameters: `I3`, `J2`, `I4bar`.
fn is_like_a_variable(word: &str) -> bool {
    let digits = word.strip_prefix(['I', 'J']).map(|rest| rest.strip_suffix("bar").unwrap_or(rest));
    digits.is_some_and(|digits| digits.chars().all(|c| c.is_ascii_digit()))
}
