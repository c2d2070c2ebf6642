//! Structures that users fill in, and that may grow.

/// A structure of public fields that may get more without breaking its users: it is `#[non_exhaustive]`, and every
/// field has a method of its name that replaces its value, so that users start from a default or a constructor:
/// `LoadOptions::default().scale(0.01).looped(true)`. Methods of
/// optional fields take values, `None` and options, those of texts whatever becomes a `String`.
///
/// With a default for every field (`pub scale: f64 = 1.0,`), it implements `Default`. With `, listed in NAME` after the
/// name of the structure it also has a constant of this name with its fields: name, type, meaning and default.
#[macro_export]
macro_rules! builder {
    ($(#[$about:meta])* pub struct $Name:ident $(<$life:lifetime>)? $(, listed in $List:ident)? { $($body:tt)* }) => {
        $crate::builder! { @structure [$(#[$about])*] $Name [$(<$life>)?] { $($body)* } }
        $crate::builder! { @default $Name [$(<$life>)?] { $($body)* } }
        impl $(<$life>)? $Name $(<$life>)? {
            $crate::builder! { @methods $Name { $($body)* } }
        }
        $crate::builder! { @list [$($List)?] $Name { $($body)* } }
    };
    (@structure [$($about:tt)*] $Name:ident [$($life:tt)*] {
        $( $(#[$meta:meta])* pub $field:ident: $type:ty $(= $default:expr)?, )*
    }) => {
        $($about)*
        #[non_exhaustive]
        pub struct $Name $($life)* { $( $(#[$meta])* pub $field: $type, )* }
    };
    (@default $Name:ident [$($life:tt)*] { $( $(#[$meta:meta])* pub $field:ident: $type:ty = $default:expr, )* }) => {
        impl $($life)* Default for $Name $($life)* {
            fn default() -> Self {
                $Name { $( $field: $default, )* }
            }
        }
    };
    (@default $($other:tt)*) => {};
    (@methods $Name:ident {}) => {};
    (@methods $Name:ident {
        $(#[$meta:meta])* pub $field:ident: Option<$type:ty> $(= $default:expr)?, $($rest:tt)*
    }) => {
        #[doc = concat!("The same with another [`", stringify!($field), "`](field@Self::", stringify!($field), ").")]
        #[must_use]
        pub fn $field(self, $field: impl Into<Option<$type>>) -> Self {
            $Name { $field: $field.into(), ..self }
        }
        $crate::builder! { @methods $Name { $($rest)* } }
    };
    (@methods $Name:ident { $(#[$meta:meta])* pub $field:ident: String $(= $default:expr)?, $($rest:tt)* }) => {
        #[doc = concat!("The same with another [`", stringify!($field), "`](field@Self::", stringify!($field), ").")]
        #[must_use]
        pub fn $field(self, $field: impl Into<String>) -> Self {
            $Name { $field: $field.into(), ..self }
        }
        $crate::builder! { @methods $Name { $($rest)* } }
    };
    (@methods $Name:ident { $(#[$meta:meta])* pub $field:ident: $type:ty $(= $default:expr)?, $($rest:tt)* }) => {
        #[doc = concat!("The same with another [`", stringify!($field), "`](field@Self::", stringify!($field), ").")]
        #[must_use]
        pub fn $field(self, $field: $type) -> Self {
            $Name { $field, ..self }
        }
        $crate::builder! { @methods $Name { $($rest)* } }
    };
    (@list [] $($other:tt)*) => {};
    (@list [$List:ident] $Name:ident {
        $( $(#[doc = $meaning:literal])* pub $field:ident: $type:ty = $default:expr, )*
    }) => {
        impl $Name {
            /// Its fields: what programs in other languages are compared with.
            #[doc(hidden)]
            pub const $List: &[$crate::builder::Listed] = &[ $( $crate::builder::Listed {
                name: stringify!($field),
                kind: stringify!($type),
                meaning: concat!($($meaning),*),
                default: stringify!($default),
            }, )* ];
        }
    };
}

/// A field of a structure, as the structure declares it.
#[derive(Clone, Copy, Debug)]
pub struct Listed {
    /// Its name.
    pub name: &'static str,
    /// Its type.
    pub kind: &'static str,
    /// What it means.
    pub meaning: &'static str,
    /// The expression of its default.
    pub default: &'static str,
}
