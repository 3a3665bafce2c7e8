// Tables as CSV, as `neurosnap export` writes it.

// A spreadsheet would run it.
const FORMULA = /^'*[\t\r\n]*[=+\-@＝＋－＠]/;

/**
 * Write rows as CSV.
 *
 * @param {(string|number|null)[][]} rows null: an empty field
 */
export function asCsv(rows) {
  return rows.map((row) => `${row.map(field).join(",")}\n`).join("");
}

function field(value) {
  if (value === null || value === undefined) return "";
  if (typeof value === "number") return String(value);
  const text = value.length > 1 && FORMULA.test(value) ? `'${value}` : value;
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** What is shown of a table, row by row, the heading first. */
export function rowsOf(table) {
  const shown = [...table.rows].filter((row) => !row.hidden);
  return shown.map((row) => [...row.cells].map((entry) => entry.textContent.trim()));
}
