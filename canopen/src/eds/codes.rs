//! The rules for data sheets, each with its stable name.

use std::fmt;

/// A rule a data sheet can break.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Code {
    /// Stable name.
    pub name: &'static str,
    /// How much breaking it matters.
    pub severity: Severity,
    /// The rule, or the reader's treatment of a violation.
    pub meaning: &'static str,
}

/// How much a diagnostic matters. The order is that of the weight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// Unusual, and no mistake or a harmless one.
    Note,
    /// Against the rules, and the meaning is clear.
    Warning,
    /// Against the rules, and what was read may not be what was meant.
    Error,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        })
    }
}

macro_rules! codes {
    ($($constant:ident = $severity:ident, $name:literal, $meaning:literal;)*) => {
        $(pub(super) const $constant: Code =
            Code { name: $name, severity: Severity::$severity, meaning: $meaning };)*

        /// Every rule.
        pub const CODES: &[Code] = &[$($constant),*];
    };
}

codes! {
    // The text
    ENCODING = Note, "eds-encoding",
        "The file is plain ASCII, and XML in UTF-16 starts with a byte order mark; UTF-8, UTF-16, \
         Latin-1 and code page 850 are decoded.";
    BYTE_ORDER_MARK = Note, "eds-byte-order-mark", "The file starts without a byte order mark.";
    LINE_END = Note, "eds-line-end", "Lines end with CR and LF.";
    SYNTAX = Error, "eds-syntax",
        "A line is empty, a comment, a section head or `key=value`, and an XDD is well-formed XML \
         of objects with numbers; others are skipped.";
    COMMENT = Note, "eds-comment",
        "A comment starts with a semicolon at the start of its line; others are cut off.";
    DUPLICATE_SECTION = Error, "eds-duplicate-section",
        "A section stands once; a second one adds what the first did not say. Of two objects of an \
         XDD the first one counts.";
    DUPLICATE_KEY = Error, "eds-duplicate-key",
        "A key stands once, and a uniqueID of an XDD; the first one counts.";
    REFERENCE = Error, "eds-reference",
        "uniqueIDRef and templateIDRef of an XDD name a uniqueID that there is.";
    MISSING_SECTION = Error, "eds-missing-section",
        "FileInfo, DeviceInfo and MandatoryObjects are there.";
    SECTION_SPELLING = Note, "eds-section-spelling",
        "Sections are called 1018 and 1018subA: upper-case digits, no leading zero, no spaces.";
    UNKNOWN_SECTION = Note, "eds-unknown-section",
        "Sections have a meaning in CiA 306; others are kept as they are.";
    UNKNOWN_KEY = Note, "eds-unknown-key",
        "Keys have a meaning in CiA 306; others are kept as they are. Attributes have one in CiA \
         311; others are left out.";
    DCF = Note, "eds-dcf",
        "What belongs into a device configuration file is kept and does not change a default.";

    // Numbers and other values
    NUMBER = Error, "eds-number", "Where a number belongs there is one.";
    RANGE = Error, "eds-range", "A number is one that its key allows.";
    NUMBER_SPELLING = Note, "eds-number-spelling",
        "A number is written 16 or 0x10, without an `h` or a suffix of C.";
    OCTAL = Warning, "eds-octal",
        "A number that starts with 0 is octal; nothing should depend on knowing that.";
    LEADING_ZERO = Note, "eds-leading-zero",
        "A number that starts with 0 is octal; with a digit 8 or 9 it is read as decimal.";
    POINT = Error, "eds-point",
        "A whole number has no decimal point; it is read when only zeros follow.";
    FLAG = Warning, "eds-flag", "A truth value is 0 or 1.";
    NODE_ID = Error, "eds-node-id",
        "`$NODEID` stands alone or in a sum with one number, and fits for every node id.";
    NODE_ID_SPELLING = Note, "eds-node-id-spelling",
        "The sum is written `$NODEID+0x180`: this order, capitals, no spaces.";
    EMPTY_DEFAULT = Note, "eds-empty-default", "A key DefaultValue has a value.";
    DEFAULT = Error, "eds-default",
        "A default value or limit is of the entry's type; another one is kept and not used.";
    DEFAULT_RANGE = Error, "eds-default-range",
        "A default value or limit fits the entry's type; another one is kept and not used.";
    OPAQUE = Note, "eds-opaque",
        "Values are of basic types; those of other types are kept and not used.";
    TWOS_COMPLEMENT = Note, "eds-twos-complement",
        "Negative numbers have a sign; 0xFF for -1 is understood.";
    REAL_BITS = Note, "eds-real-bits",
        "A real number in hex of full width is read as its bits, another one as a number.";
    LIMIT_TYPE = Warning, "eds-limit-type", "Only numbers have limits; others are kept.";

    // File and device
    EDS_VERSION = Warning, "eds-version", "EDSVersion is there and reads like 4.0.";
    DATE = Warning, "eds-date", "Dates read like 12-31-2024 and times like 11:59PM.";
    DEVICE_INFO = Warning, "eds-device-info", "DeviceInfo says all it must.";
    BIT_RATE = Note, "eds-bit-rate", "BaudRate keys name the bit rates that CiA 301 knows.";
    COMMISSIONING = Warning, "eds-commissioning",
        "DeviceComissioning has a node id from 1 to 127 and a bit rate of CiA 301.";
    DUMMY = Warning, "eds-dummy", "DummyUsage names Dummy0001 to Dummy0007, or is absent.";
    LINES = Warning, "eds-lines", "Lines counts the comment lines, which are numbered from 1.";

    // Lists of objects
    LIST_COUNT = Error, "eds-list-count",
        "SupportedObjects counts the objects of its list, and NrOfEntries the entries.";
    LIST_KEY = Error, "eds-list-key", "The keys of a list are 1, 2, 3 and so on.";
    LIST_RANGE = Error, "eds-list-range",
        "2000h to 5FFFh are in ManufacturerObjects, all others are not.";
    LISTED_TWICE = Warning, "eds-listed-twice", "An object is listed once.";
    NOT_LISTED = Warning, "eds-not-listed", "An object is listed; one that is not is read anyway.";
    NO_SECTION = Error, "eds-no-section", "An object that is listed has a section.";

    // Objects
    NAME_MISSING = Error, "eds-name-missing", "Objects and subs have a ParameterName.";
    OBJECT_TYPE_MISSING = Warning, "eds-object-type-missing",
        "Objects and subs have an ObjectType; VAR is taken, or what the subs suggest.";
    OBJECT_TYPE = Error, "eds-object-type", "ObjectType is one that CiA 301 knows.";
    DATA_TYPE_MISSING = Error, "eds-data-type-missing", "Values have a DataType.";
    DATA_TYPE = Error, "eds-data-type", "DataType is basic or defined in the dictionary.";
    DATA_TYPE_DECIMAL = Note, "eds-data-type-decimal", "DataType is written in hex.";
    ACCESS_MISSING = Error, "eds-access-missing", "Values have an AccessType; ro is assumed.";
    ACCESS = Error, "eds-access",
        "AccessType is one of ro, wo, rw, rwr, rww, const; ro is assumed.";
    ACCESS_SPELLING = Warning, "eds-access-spelling", "AccessType is in small letters.";
    NO_ACCESS = Warning, "eds-no-access",
        "SDOs reach a value; `noAccess`, which CiA 311 alone has, leaves PDOs or nothing.";
    DISABLED = Note, "eds-disabled",
        "An object of an XDD is in the device; one that the editor marks as disabled is left out.";
    SUB_NUMBER = Error, "eds-subnumber", "SubNumber counts the subs.";
    SUB0_MISSING = Error, "eds-sub0-missing", "Arrays and records have a sub 0.";
    SUB0_TYPE = Error, "eds-sub0-type", "Sub 0 of arrays and records is UNSIGNED8.";
    SUB0_COUNT = Error, "eds-sub0-count",
        "Sub 0 is the highest sub-index, not the number of subs.";
    SUB0_DEFAULT = Warning, "eds-sub0-default", "Sub 0 has a default value.";
    SUB_DECIMAL = Warning, "eds-sub-decimal",
        "Sub-indices in section names are hex: after sub9 comes subA.";
    PARENT_MISSING = Error, "eds-parent-missing",
        "Subs have an object; without a section of its own it is taken to be a record.";
    SUB_OF_VAR = Error, "eds-sub-of-var",
        "Only arrays and records have subs; another object with subs is read as one.";
    NO_SUBS = Error, "eds-no-subs",
        "Arrays and records have subs; one that has a type of its own is read as VAR.";
    ARRAY_TYPES = Error, "eds-array-types", "The elements of an array are of one type.";
    OBJECT_KIND = Error, "eds-object-kind",
        "Objects of CiA 301 have the object type given there.";
    COMPACT = Warning, "eds-compact",
        "CompactSubObj and its name and value sections agree with each other.";
    COMPACT_PDO = Note, "eds-compact-pdo", "PDOs that CompactPDO stands for are read as objects.";

    // Modules
    MODULE = Note, "eds-module",
        "The sheet of a modular device, or who uses it, says which modules are connected.";
    MODULE_SECTION = Error, "eds-module-section",
        "SupportedModules counts the modules; each has a ModuleInfo.";
    MODULE_INFO = Warning, "eds-module-info",
        "ModuleInfo names product, version, revision and order code.";
    MODULE_LIST = Warning, "eds-module-list", "A modular device has 1027h, the list of modules.";
    MODULE_OBJECT = Error, "eds-module-object",
        "An object is the device's own, fixed or extended: one of the three. A fixed one is the \
         same in all modules.";
    SUB_EXTEND = Error, "eds-sub-extend",
        "Count says what a module adds to an object: sub-indices, or bits of one that modules \
         share. The object has room for it.";
    CONNECTED_MODULE = Error, "eds-connected-module",
        "ConnectedModules names modules that there are, 254 at most.";

    // The device as a whole
    MANDATORY_OBJECT = Error, "eds-mandatory-object", "1000h, 1001h and 1018h are there.";
    ERROR_CONTROL = Error, "eds-error-control", "1017h is there, or 100Ch and 100Dh are.";
    IDENTITY = Warning, "eds-identity",
        "VendorNumber, ProductNumber and RevisionNumber are the defaults of 1018h.";
    LIMITS = Error, "eds-limits", "LowLimit is not above HighLimit.";
    DEFAULT_LIMIT = Error, "eds-default-limit", "A default value is within its limits.";

    // Process data
    PDO_COUNT = Error, "eds-pdo-count", "NrOfRXPDO and NrOfTXPDO count the PDOs.";
    PDO_PAIR = Error, "eds-pdo-pair",
        "A PDO has a communication parameter and, 200h higher, a mapping parameter.";
    PDO_ENTRY = Error, "eds-pdo-entry",
        "Communication parameters have subs 1 and 2, and all subs are of their type.";
    PDO_RESERVED = Warning, "eds-pdo-reserved",
        "Communication parameters have no sub 4, a compatibility entry of early editions.";
    TRANSMISSION_TYPE = Error, "eds-transmission-type",
        "Transmission types are 0 to 240, 254, 255, and for TPDOs 252 and 253.";
    PDO_DIRECTION = Error, "eds-pdo-direction",
        "The AccessType of a mapped object fits the direction: rwr for TPDOs, rww for RPDOs. \
         PDOmapping of an XDD does not contradict it.";
    MAPPING_DIRECTION = Warning, "eds-mapping-direction",
        "The AccessType of a mappable object names its direction: rwr or rww. In an XDD the access \
         of its parameter does, or PDOmapping.";
    MAPPING_OBJECT = Error, "eds-mapping-object",
        "A default mapping names objects that exist; dummies are in DummyUsage and for RPDOs.";
    MAPPING_ACCESS = Error, "eds-mapping-access", "An object mapped by default has PDOMapping=1.";
    MAPPING_LENGTH = Error, "eds-mapping-length", "A mapping names the length of its object.";
    MAPPING_SUM = Error, "eds-mapping-sum", "A PDO has at most 64 bits.";
    MAPPING_COUNT = Error, "eds-mapping-count",
        "Sub 0 of a mapping counts entries that map something.";
    MAPPING_SPARE = Note, "eds-mapping-spare",
        "Sub 0 of a mapping counts all entries that map something.";
    COB_ID_DUPLICATE = Warning, "eds-cob-id-duplicate",
        "No two services have the same default identifier.";
    COB_ID_RESTRICTED = Warning, "eds-cob-id-restricted",
        "Default identifiers avoid those that CiA 301 reserves for other services.";
    COB_ID_LENGTH = Warning, "eds-cob-id-length",
        "A default identifier of more than 11 bits has bit 29 set.";
    COB_ID_PREDEFINED = Warning, "eds-cob-id-predefined",
        "PDO 1 to 4 have the identifiers of the predefined connection set.";
}
