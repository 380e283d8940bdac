//! How decisions are written down, those of the stack and those of applications.

/// A trait of decisions. A layer that does not take a decision itself leaves it to the rules
/// beneath, and the lowest layer takes the one that is written here.
macro_rules! decisions {
    (
        $(#[$about:meta])*
        $visibility:vis trait $trait:ident: $($layer:path),+;
        $(
            $(#[$doc:meta])*
            fn $name:ident(&$self:ident $(, $argument:ident: $type:ty)* $(,)?) -> $result:ty
                $body:block
        )*
    ) => {
        $(#[$about])*
        $visibility trait $trait: $($layer +)+ {
            $(
                $(#[$doc])*
                fn $name(&$self $(, $argument: $type)*) -> $result {
                    match $self.beneath() {
                        Some(rules) => rules.$name($($argument),*),
                        None => $body,
                    }
                }
            )*
        }
    };
}

/// The decisions of one layer, a struct of the rules beneath and what notes that it is muted. A
/// layer that is muted decides as the rules beneath, and notes where it would not have.
macro_rules! taken_otherwise {
    ($(
        fn $name:ident(&$self:ident $(, $argument:ident: $type:ty)* $(,)?) -> $result:ty
            $body:block
    )*) => {
        $(
            fn $name(&$self $(, $argument: $type)*) -> $result {
                let beneath = $self.1.as_ref().map(|dissent| {
                    (dissent, $self.0.$name($(Clone::clone(&$argument)),*))
                });
                let taken: $result = $body;
                match beneath {
                    None => taken,
                    Some((dissent, beneath)) => {
                        if taken != beneath {
                            dissent.note(stringify!($name));
                        }
                        beneath
                    }
                }
            }
        )*
    };
}
