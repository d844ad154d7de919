// Names of properties that only this package's own modules use, so that a bundle may shorten them.
import { createRequire } from "node:module";
import { fileURLToPath } from "node:url";

/** Modules whose names users see, but for private ones; of others all names are shortened. */
const PUBLIC = /\/src\/(events|errors|metadata|coordinates|decoder|stream|worker|world|three|draw|text|curves|maplibre|leaflet|main\/profile|tiles\/(file|types))\.ts$/;

/** A pattern of the names that may be shortened: declared in `src`, nowhere public, and never looked up in a library's objects. */
export function internalNames() {
  const folder = fileURLToPath(new URL(".", import.meta.url));
  const ts = createRequire(import.meta.url)("typescript");
  const { options, fileNames } = ts.getParsedCommandLineOfConfigFile(`${folder}tsconfig.json`, {}, {
    ...ts.sys, onUnRecoverableConfigFileDiagnostic: (error) => { throw new Error(error.messageText); },
  });
  const program = ts.createProgram(fileNames, options, ts.createCompilerHost(options, true)), checker = program.getTypeChecker(), own = new Set(), kept = new Set();
  const foreign = (symbol) => symbol?.declarations?.some((each) => !fileNames.includes(each.getSourceFile().fileName)) ?? true;
  const keep = (name, symbol) => foreign(symbol) && kept.add(name);
  for (const file of program.getSourceFiles().filter((each) => fileNames.includes(each.fileName))) {
    const open = PUBLIC.test(file.fileName);
    const declared = (node) => {
      const hidden = node.modifiers?.some((each) => each.kind === ts.SyntaxKind.PrivateKeyword);
      (open && !hidden ? kept : own).add(node.name.text);
    };
    const visit = (node) => {
      const named = node.name && ts.isIdentifier(node.name);
      if (named && (ts.isClassElement(node) || ts.isTypeElement(node))) declared(node);
      else if (named && ts.isParameter(node) && ts.isParameterPropertyDeclaration(node, node.parent)) declared(node);
      else if (ts.isPropertyAccessExpression(node) && named) keep(node.name.text, checker.getSymbolAtLocation(node.name));
      else if (ts.isBindingElement(node) && ts.isObjectBindingPattern(node.parent)) {
        const name = (node.propertyName ?? node.name).text, type = checker.getTypeAtLocation(node.parent);
        keep(name, checker.getPropertyOfType(type, name));
      } else if (named && ts.isObjectLiteralElement(node)) {
        const type = checker.getContextualType(node.parent), property = type && checker.getPropertyOfType(type, node.name.text);
        if (type) keep(node.name.text, property);
        else own.add(node.name.text);
      } else if (ts.isStringLiteral(node)) kept.add(node.text);
      ts.forEachChild(node, visit);
    };
    visit(file);
  }
  return new RegExp(`^(${[...own].filter((name) => !kept.has(name)).sort().join("|")})$`);
}
