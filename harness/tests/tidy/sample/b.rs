//! Groups, within groups, and a module within the file.

use crate::{
    a::sibling::{self, sibling as renamed},
    c::{C},
};

mod within {
    use super::renamed;
}

#[cfg(test)]
mod tests {
    use crate::a::Inner;
}
