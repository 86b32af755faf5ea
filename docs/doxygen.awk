# SPDX-License-Identifier: BSD-3-Clause
# Doxygen's filter for Markdown pages, which are written for a code-hosting site:
# awk -f docs/doxygen.awk page.md
#
#   $x$ and $`x`$        become \f$x\f$
#   ```math … ```        becomes \f[ … \f]
#   the title of a page of docs/ gets a label, and links to these pages become references, since
#   Doxygen resolves links between Markdown files by their absolute path, and not where it has spaces
#
# Code, in fences and in the line, stays as it is.

function formulas(line,   done, part) {
  done = ""
  while (match(line, /\$`[^`]+`\$|`+[^`]+`+|\$[^$`]+\$/)) {
    part = substr(line, RSTART, RLENGTH)
    done = done substr(line, 1, RSTART - 1)
    line = substr(line, RSTART + RLENGTH)
    if (part ~ /^\$`/) part = "\\f$" substr(part, 3, length(part) - 4) "\\f$"
    else if (part ~ /^\$/) part = "\\f$" substr(part, 2, length(part) - 2) "\\f$"
    done = done part
  }
  return done line
}

function links(line,   done, part) {
  done = ""
  while (match(line, /\]\((docs\/)?[a-z0-9_]+\.md\)/)) {
    part = substr(line, RSTART + 2, RLENGTH - 6)
    sub(/^docs\//, "", part)
    done = done substr(line, 1, RSTART - 1) "](\\ref " part ")"
    line = substr(line, RSTART + RLENGTH)
  }
  line = done line
  # Only the text remains of links to files of the root, which are no pages, and to headings, which
  # have other anchors.
  while (match(line, /\[[^]]+\]\(((\.\.\/)?[A-Z]+\.(md|cff)|#[a-z0-9_-]+)\)/)) {
    part = substr(line, RSTART + 1, RLENGTH - 1)
    sub(/\].*/, "", part)
    line = substr(line, 1, RSTART - 1) part substr(line, RSTART + RLENGTH)
  }
  return line
}

FNR == 1 && /^# / && FILENAME ~ /(^|\/)docs\/[a-z0-9_]+\.md$/ {
  label = FILENAME
  sub(/.*\//, "", label)
  sub(/\.md$/, "", label)
  print formulas($0) " {#" label "}"
  next
}
/^ *```/ && fence == "" {
  fence = /^ *```math *$/ ? "math" : "code"
  print fence == "math" ? "\\f[" : $0
  next
}
/^ *``` *$/ {
  print fence == "math" ? "\\f]" : $0
  fence = ""
  next
}
fence != "" { print; next }
{ print links(formulas($0)) }
